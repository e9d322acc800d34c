# SPDX-License-Identifier: GPL-3.0-or-later
"""The daemon under test, and a client of it that is nothing but Debian's gRPC and stubs made from the .proto."""
import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, os.environ.get("STUBS", "build/release/tests/e2e/stubs"))
import grpc  # noqa: E402
from maps.service.v1 import map_service_pb2 as pb  # noqa: E402
from maps.service.v1 import map_service_pb2_grpc as rpc  # noqa: E402

DAEMON = os.environ.get("MAPCODECD", "build/release/bin/mapcodecd")


def memory_factor():
    """A daemon with AddressSanitizer holds back what was freed, and pads the rest."""
    return 3 if b"__asan_init" in Path(DAEMON).read_bytes() else 1


class Daemon:
    """Runs on a free port of loopback until `stop`."""

    def __init__(self, data, *arguments, listen="127.0.0.1:0", **options):
        self.port_file = Path(data).parent / f"ports-{time.monotonic_ns()}"
        command = [DAEMON, "--data", data, "--port-file", self.port_file, "--listen", listen, "--http", "127.0.0.1:0", *arguments]
        self.log = tempfile.TemporaryFile()
        self.process = subprocess.Popen([str(c) for c in command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                        stderr=self.log, **options)
        self.address = self.wait_for_address()

    def wait_for_address(self):
        for _ in range(1200):
            if self.port_file.exists():
                return self.port_file.read_text().split()[0]
            if self.process.poll() is not None:
                raise RuntimeError(f"the daemon ended with {self.process.returncode}: {self.said()}")
            time.sleep(0.05)
        raise RuntimeError("the daemon does not listen: " + self.said())

    def said(self):
        self.log.seek(0)
        return self.log.read().decode(errors="replace")

    def channel(self):
        return grpc.insecure_channel(self.address, options=[("grpc.max_receive_message_length", 64 << 20)])

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.log.close()

    def stop(self):
        """@return the exit code after SIGTERM."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=60)


def scan_of(seed, count, spread=20.0):
    """Points of a scan, packed float32; different for each seed."""
    rng = random.Random(seed)
    return struct.pack(f"<{3 * count}f", *(rng.uniform(-spread, spread) for _ in range(3 * count)))


def points(packed, channels=()):
    return pb.Points(count=len(packed) // 12, xyz_f32=packed, channels=channels)


def opening(name, writer="", acknowledged=0):
    return pb.InsertRequest(open=pb.InsertOpen(map=name, writer=writer, acknowledged=acknowledged))


def scan(sequence, packed, **fields):
    return pb.InsertRequest(scan=pb.InsertScan(sequence=sequence, points=points(packed), **fields))


def insert(stub, name, scans, writer="", timeout=60):
    """@return (sequence, revision) of the last acknowledgement."""
    last = (0, 0)
    for reply in stub.Insert(iter([opening(name, writer), *scans]), timeout=timeout):
        if not reply.opened:
            last = (reply.sequence, reply.revision)
    return last


def fetch(stub, timeout=60, **request):
    """@return facts, [(tile, its bytes)]"""
    facts, tiles = None, []
    for reply in stub.GetTiles(pb.GetTilesRequest(**request), timeout=timeout):
        if reply.HasField("facts"):
            facts = reply.facts
        if reply.HasField("tile"):
            tiles.append([reply.tile, b""])
        if reply.data:
            tiles[-1][1] += reply.data
    return facts, tiles


class DaemonTest(unittest.TestCase):
    """A folder and a daemon of its own for every test."""

    arguments = ()

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="mapcodec-daemon-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.data = self.folder / "maps"
        self.data.mkdir()
        self.start()

    def start(self, *arguments):
        self.daemon = Daemon(self.data, *self.arguments, *arguments)
        self.addCleanup(self.daemon.kill)
        channel = self.daemon.channel()
        self.addCleanup(channel.close)
        self.stub = rpc.MapServiceStub(channel)

    def files(self):
        """Names of what lies in the folder beside the daemon's catalogue."""
        return [p.name for p in self.data.iterdir() if not p.name.startswith("catalogue.db")]

    def create(self, name="m", **fields):
        fields.setdefault("promise", pb.CreateMapRequest.MAX_ERROR)
        fields.setdefault("promise_m", 0.01)
        return self.stub.CreateMap(pb.CreateMapRequest(map=name, **fields), timeout=60)

    def refuses(self, code, call, says="."):
        with self.assertRaises(grpc.RpcError) as caught:
            result = call()
            for _ in result if hasattr(result, "__iter__") else ():
                pass
        self.assertEqual(caught.exception.code(), code, caught.exception.details())
        self.assertRegex(caught.exception.details(), says)
        return caught.exception

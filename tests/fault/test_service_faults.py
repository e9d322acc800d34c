# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodecd is killed under load, and its disk is full. MAPCODEC_SERVICE_KILLS: how often (default 4)."""
import os
import queue
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "e2e"))
import grpc  # noqa: E402

from daemon import Daemon, fetch, opening, pb, rpc, scan, scan_of  # noqa: E402

KILLS = int(os.environ.get("MAPCODEC_SERVICE_KILLS", "4"))
PROGRAM = os.environ.get("MAPCODEC", "build/release/bin/mapcodec")
POINTS = 2000


class Robot(threading.Thread):
    """Sends scans one after the other, and goes on where the service says it is when the connection is back."""

    def __init__(self, name, where, enough):
        super().__init__(daemon=True)
        self.writer, self.where, self.enough = name, where, enough
        self.acknowledged, self.faults, self.connections = 0, [], 0

    def scan(self, sequence):
        return scan(sequence, scan_of(f"{self.writer}/{sequence}", POINTS))

    def requests(self, from_sequence):
        yield opening("m", self.writer, self.acknowledged)
        sequence = from_sequence.get()
        while sequence is not None and not self.enough.is_set():
            sequence += 1
            self.last = sequence
            # A few scans may be under way.
            while sequence > self.acknowledged + 8 and not self.enough.is_set():
                time.sleep(0.002)
            yield self.scan(sequence)

    def connect(self):
        stub = rpc.MapServiceStub(grpc.insecure_channel(self.where()))
        begin = queue.Queue()
        try:
            for reply in stub.Insert(self.requests(begin), timeout=60):
                if reply.opened:
                    if reply.sequence < self.acknowledged:
                        self.faults.append(f"{self.writer}: {self.acknowledged} was acknowledged, {reply.sequence} is there")
                    begin.put(reply.sequence)
                    self.connections += 1
                self.acknowledged = max(self.acknowledged, reply.sequence)
        except grpc.RpcError as e:
            begin.put(None)
            if e.code() not in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.RESOURCE_EXHAUSTED):
                self.faults.append(f"{self.writer}: {e.code()} {e.details()}")
            time.sleep(0.05)

    def run(self):
        self.last = 0
        while not (self.enough.is_set() and self.acknowledged >= self.last) and not self.faults:
            if self.enough.is_set():
                self.finish()
            else:
                self.connect()

    def finish(self):
        """Whatever was begun is sent again until it is there."""
        stub = rpc.MapServiceStub(grpc.insecure_channel(self.where()))
        try:
            scans = [self.scan(i) for i in range(self.acknowledged + 1, self.last + 1)]
            for reply in stub.Insert(iter([opening("m", self.writer, self.acknowledged), *scans]), timeout=60):
                self.acknowledged = max(self.acknowledged, reply.sequence)
        except grpc.RpcError:
            time.sleep(0.05)


class Faults(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="mapcodec-kills-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.data = self.folder / "maps"
        self.data.mkdir()

    def create(self, daemon):
        stub = rpc.MapServiceStub(daemon.channel())
        stub.CreateMap(pb.CreateMapRequest(map="m", promise=pb.CreateMapRequest.LOSSLESS), timeout=60)
        return stub

    def test_kills_under_load(self):
        rng = random.Random(1)
        daemon = Daemon(self.data)
        self.create(daemon)
        enough = threading.Event()
        current = {"address": daemon.address}
        robots = [Robot(f"robot-{k}", lambda: current["address"], enough) for k in range(3)]
        for r in robots:
            r.start()
        for _ in range(KILLS):
            time.sleep(rng.uniform(0.05, 0.6))
            daemon.kill()
            verified = subprocess.run([PROGRAM, "verify", self.data / "m.mapc"], capture_output=True, text=True)
            self.assertEqual(verified.returncode, 0, verified.stderr)
            daemon = Daemon(self.data)
            current["address"] = daemon.address
        time.sleep(1)
        enough.set()
        for r in robots:
            r.join(timeout=120)
            self.assertFalse(r.is_alive(), "a client does not finish")
            self.assertEqual(r.faults, [])
            self.assertGreater(r.connections, 1)
        stub = rpc.MapServiceStub(daemon.channel())
        points = stub.Stats(pb.StatsRequest(map="m"), timeout=60).map.points
        self.assertEqual(points, POINTS * sum(r.last for r in robots), "a scan is missing, half there, or there twice")
        print(f"{KILLS} kills, {sum(r.last for r in robots)} scans, each there once", file=sys.stderr)
        self.assertEqual(daemon.stop(), 0)

    def test_full_disk(self):
        daemon = Daemon(self.data)
        self.addCleanup(daemon.kill)
        stub = self.create(daemon)
        send = lambda k: list(stub.Insert(iter([opening("m", "r"), scan(k, scan_of(k, 20000))]), timeout=60))  # noqa: E731
        send(1)
        size = (self.data / "m.mapc").stat().st_size
        # The disk has no room for more of this file.
        resource.prlimit(daemon.process.pid, resource.RLIMIT_FSIZE, (size + 20000, resource.RLIM_INFINITY))
        for _ in range(3):
            with self.assertRaises(grpc.RpcError) as caught:
                send(2)
            self.assertEqual(caught.exception.code(), grpc.StatusCode.RESOURCE_EXHAUSTED)
            trailing = dict(caught.exception.trailing_metadata())
            self.assertEqual(trailing["mapcodec-error"], "CannotWrite")
            self.assertGreater(int(trailing["retry-after-ms"]), 0)
            facts, tiles = fetch(stub, map="m")  # reads go on
            self.assertEqual((facts.revision, sum(t[0].points for t in tiles)), (2, 20000))
        resource.prlimit(daemon.process.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        replies = send(2)
        self.assertEqual(replies[-1].sequence, 2)
        self.assertEqual(stub.Stats(pb.StatsRequest(map="m"), timeout=60).map.points, 40000)
        self.assertEqual(daemon.stop(), 0)
        verified = subprocess.run([PROGRAM, "verify", self.data / "m.mapc"], capture_output=True, text=True)
        self.assertEqual(verified.returncode, 0, verified.stderr)

    def small_disk(self):
        """A file system of its own, and a file that fills most of it."""
        disk = self.folder / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8M", "none", disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("a file system cannot be mounted here")
        self.addCleanup(subprocess.run, ["umount", "--lazy", disk], check=True)
        return disk

    def test_full_file_system(self):
        disk = self.small_disk()
        self.data = disk / "maps"
        self.data.mkdir()
        daemon = Daemon(self.data)
        self.addCleanup(daemon.kill)
        stub = self.create(daemon)
        send = lambda k: list(stub.Insert(iter([opening("m", "r"), scan(k, scan_of(k, 20000))]), timeout=60))  # noqa: E731
        send(1)
        filler = disk / "filler"
        with self.assertRaises(OSError), open(filler, "wb", buffering=0) as f:
            while f.write(bytes(4096)):
                pass
        for _ in range(3):
            for call in (lambda: send(2), lambda: stub.Compact(pb.CompactRequest(map="m"), timeout=60),
                         lambda: stub.CreateMap(pb.CreateMapRequest(map="n", promise=pb.CreateMapRequest.LOSSLESS), timeout=60)):
                with self.assertRaises(grpc.RpcError) as caught:
                    call()
                self.assertEqual(caught.exception.code(), grpc.StatusCode.RESOURCE_EXHAUSTED, caught.exception.details())
                self.assertRegex(caught.exception.details(), "space")
            facts, tiles = fetch(stub, map="m")
            self.assertEqual((facts.revision, sum(t[0].points for t in tiles)), (2, 20000))
        filler.unlink()
        send(2)
        self.create_another(stub)
        self.assertEqual(stub.Stats(pb.StatsRequest(map="m"), timeout=60).map.points, 40000)
        self.assertEqual(daemon.stop(), 0)
        verified = subprocess.run([PROGRAM, "verify", self.data / "m.mapc"], capture_output=True, text=True)
        self.assertEqual(verified.returncode, 0, verified.stderr)

    @staticmethod
    def create_another(stub):
        stub.CreateMap(pb.CreateMapRequest(map="n", promise=pb.CreateMapRequest.LOSSLESS), timeout=60)


if __name__ == "__main__":
    unittest.main()

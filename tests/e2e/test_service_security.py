# SPDX-License-Identifier: GPL-3.0-or-later
"""What the daemon refuses: strangers, wrong certificates, tricks, too much, too many, and lies.

MAPCODEC_CONNECTIONS=10000 opens as many connections (both ends count against their process's file limit);
MAPCODEC_FUZZ_SECONDS=600 sends malformed messages for so long, beside the 150 of every run."""
import http.client
import os
import random
import resource
import shutil
import socket
import ssl
import stat
import struct
import subprocess
import tempfile
import threading
import time
import unittest
import warnings
from pathlib import Path

import grpc

from certificates import Authority
from daemon import DAEMON, Daemon, DaemonTest, fetch, insert, memory_factor, opening, pb, rpc, scan, scan_of

CONNECTIONS = int(os.environ.get("MAPCODEC_CONNECTIONS", "1500"))
FUZZ_SECONDS = float(os.environ.get("MAPCODEC_FUZZ_SECONDS", "0"))
READ, WRITE, ADMIN = "read", "write", "admin"


class SecureTest(DaemonTest):
    """A daemon where everybody needs a token."""

    config = '[access]\ntokens = "required"\n'
    http = True

    def start(self, *arguments):
        file = self.folder / "config.toml"
        file.write_text(self.config)
        listen = ("--http", "127.0.0.1:0") if self.http else ()
        super().start("--config", file, *listen, *arguments)

    def http_status(self, path, token=None, **headers):
        address = next(a for a in self.daemon.port_file.read_text().split() if a.startswith("http://")).split("//")[1]
        connection = http.client.HTTPConnection(address, timeout=20)
        if token is not None:
            headers["Authorization"] = "Bearer " + token
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer.status

    def token(self, name, *grants, expires=None):
        command = [DAEMON, "token", "add", name, "--data", self.data]
        for grant in grants:
            command += ["--map", grant]
        if expires:
            command += ["--expires", expires]
        return subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True, timeout=60).stdout.strip()


def bearer(token):
    return [("authorization", "Bearer " + token)]


class Tokens(SecureTest):
    def calls(self, token):
        """name -> call, with the token or without."""
        m = bearer(token) if token is not None else None
        s = self.stub
        return {
            "stats": lambda: s.Stats(pb.StatsRequest(map="m"), metadata=m, timeout=20),
            "tiles": lambda: list(s.GetTiles(pb.GetTilesRequest(map="m"), metadata=m, timeout=20)),
            "insert": lambda: list(s.Insert(iter([opening("m"), scan(1, scan_of(1, 100))]), metadata=m, timeout=20)),
            "pose": lambda: s.SetPoses(pb.SetPosesRequest(map="m"), metadata=m, timeout=20),
            "rollback": lambda: s.Rollback(pb.RollbackRequest(map="m", revision="1"), metadata=m, timeout=20),
            "delete": lambda: s.DeleteMap(pb.DeleteMapRequest(map="m"), metadata=m, timeout=20),
            "create": lambda: s.CreateMap(pb.CreateMapRequest(map="n", promise=pb.CreateMapRequest.MAX_ERROR, promise_m=0.01), metadata=m, timeout=20),
        }

    def make_map(self):
        self.admin = self.token("boss", "*:admin")
        self.stub.CreateMap(pb.CreateMapRequest(map="m", promise=pb.CreateMapRequest.MAX_ERROR, promise_m=0.01),
                            metadata=bearer(self.admin), timeout=20)
        self.calls(self.admin)["insert"]()

    def test_no_token_and_wrong_tokens(self):
        self.make_map()
        for token in (None, "", "mct_wrong", self.admin[:-1], self.admin + "x", "' OR 1=1 --"):
            for name, call in self.calls(token).items():
                with self.subTest(token=token, call=name):
                    self.refuses(grpc.StatusCode.UNAUTHENTICATED, call, "token")
            self.assertEqual(self.http_status("/maps/m/index", token), 401)
            self.assertEqual(self.http_status("/metrics", token), 401)
            self.assertEqual(self.http_status("/maps/secret/index", token), 401)  # nor does it tell what exists
        self.assertEqual(self.http_status("/healthz"), 200)
        self.assertEqual(self.http_status("/maps/m/index", Authorization="Basic " + self.admin), 401)
        self.assertEqual(self.http_status("/maps/m/index", self.admin), 200)

    def test_read_token_does_not_write(self):
        self.make_map()
        reader = self.token("reader", "m:read")
        calls = self.calls(reader)
        for name in ("stats", "tiles"):
            calls[name]()
        self.assertEqual(self.http_status("/maps/m/index", reader), 200)
        for name in ("insert", "pose", "rollback", "delete", "create"):
            with self.subTest(call=name):
                self.refuses(grpc.StatusCode.PERMISSION_DENIED, calls[name], "right")
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), metadata=bearer(reader), timeout=20).map.revision, 2)

    def test_write_token_does_not_govern(self):
        self.make_map()
        writer = self.token("writer", "m:write")
        self.calls(writer)["insert"]()
        for name in ("delete", "create"):
            self.refuses(grpc.StatusCode.PERMISSION_DENIED, self.calls(writer)[name], "right")

    def test_a_token_is_for_its_maps(self):
        self.make_map()
        other = self.token("other", "other:admin")
        for name in ("stats", "tiles", "insert", "delete"):
            self.refuses(grpc.StatusCode.PERMISSION_DENIED, self.calls(other)[name], "right")
        self.assertEqual(self.http_status("/maps/m/index", other), 403)
        listed = self.stub.ListMaps(pb.ListMapsRequest(), metadata=bearer(other), timeout=20).maps
        self.assertEqual([m.map for m in listed], [])

    def test_expired_and_revoked_tokens(self):
        self.make_map()
        short, gone = self.token("short", "m:read", expires="1s"), self.token("gone", "m:read")
        self.calls(gone)["stats"]()
        subprocess.run([DAEMON, "token", "revoke", "gone", "--data", str(self.data)], check=True, timeout=60)
        self.refuses(grpc.StatusCode.UNAUTHENTICATED, self.calls(gone)["stats"], "not known")
        time.sleep(2.1)
        self.refuses(grpc.StatusCode.UNAUTHENTICATED, self.calls(short)["stats"], "expired")
        self.assertEqual(self.http_status("/maps/m/index", short), 401)
        listed = subprocess.run([DAEMON, "token", "list", "--json", "--data", str(self.data)], check=True, capture_output=True, text=True).stdout
        self.assertIn('"expired":true', listed)
        self.assertNotIn("mct_", listed)

    def test_secrets_do_not_reach_the_log(self):
        self.make_map()
        self.http_status("/maps/m/index", self.admin)
        self.assertNotIn(self.admin, self.daemon.said())
        self.assertIn("principal=boss", self.daemon.said())


class LocalPolicy(DaemonTest):
    def test_local_clients_need_no_token_but_a_wrong_one_is_refused(self):
        self.create()
        self.refuses(grpc.StatusCode.UNAUTHENTICATED,
                     lambda: self.stub.Stats(pb.StatsRequest(map="m"), metadata=bearer("mct_wrong"), timeout=20))


class Listening(unittest.TestCase):
    def refused(self, *arguments):
        outcome = subprocess.run([DAEMON, "--data", "/tmp", *arguments], capture_output=True, text=True, timeout=60)
        self.assertEqual(outcome.returncode, 2, outcome)
        self.assertRegex(outcome.stderr, r"\Amapcodecd: [^\n]+\n\Z")
        return outcome.stderr

    def test_plain_text_stays_here(self):
        for address in ("0.0.0.0:0", "[::]:0", "10.1.2.3:0"):
            self.assertIn("insecure", self.refused("--listen", address))
            self.assertIn("insecure", self.refused("--listen", "127.0.0.1:0", "--http", address))

    def test_names_are_no_addresses(self):
        # 127.example.com is not loopback, and what localhost.example.com means changes.
        for address in ("127.example.com:0", "localhost.example.com:0", "*:0", "nothing", "unix:relative"):
            self.refused("--listen", address, "--insecure")


class Sockets(unittest.TestCase):
    def test_sockets_are_private(self):
        folder = Path(tempfile.mkdtemp(prefix="mapcodec-daemon-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        data, grpc_socket, http_socket = folder / "maps", folder / "grpc.sock", folder / "http.sock"
        data.mkdir()
        daemon = Daemon(data, "--http", f"unix:{http_socket}", listen=f"unix:{grpc_socket}")
        self.addCleanup(daemon.kill)
        for path in (grpc_socket, http_socket):
            self.assertEqual(stat.S_IMODE(path.stat().st_mode), 0o600)
        with grpc.insecure_channel(f"unix:{grpc_socket}") as channel:
            self.assertEqual(len(rpc.MapServiceStub(channel).ListMaps(pb.ListMapsRequest(), timeout=20).maps), 0)
        page = subprocess.run(["curl", "-s", "--unix-socket", http_socket, "http://localhost/healthz"], capture_output=True)
        self.assertEqual(page.stdout, b"ok\n")
        # A socket that is served is not taken away.
        second = subprocess.run([DAEMON, "--data", data, "--listen", f"unix:{grpc_socket}"], capture_output=True, text=True, timeout=60)
        self.assertEqual(second.returncode, 4, second)
        self.assertEqual(daemon.stop(), 0)
        self.assertFalse(grpc_socket.exists() or http_socket.exists())


class Certificates(SecureTest):
    client_ca = False

    def setUp(self):
        self.papers = tempfile.TemporaryDirectory()
        self.addCleanup(self.papers.cleanup)
        self.authority = Authority(self.papers.name)
        self.server = self.authority.sign("server")
        self.config = self.tls_config(self.server)
        super().setUp()
        self.secret = self.token("boss", "*:admin")

    def tls_config(self, server):
        text = f'[access]\ntokens = "required"\n[tls]\ncertificate_file = "{server[0]}"\nkey_file = "{server[1]}"\n'
        return text + (f'client_ca_file = "{self.authority.certificate}"\n' if self.client_ca else "")

    def list_maps(self, identity=None, token=None, authority=None):
        """By gRPC over TLS."""
        root = (authority or self.authority).certificate.read_bytes()
        chain, key = (p.read_bytes() for p in identity) if identity else (None, None)
        with grpc.secure_channel(self.daemon.address, grpc.ssl_channel_credentials(root, key, chain)) as channel:
            return rpc.MapServiceStub(channel).ListMaps(pb.ListMapsRequest(), metadata=bearer(token or self.secret), timeout=8)

    def curl(self, *arguments):
        """@return exit code, HTTP status"""
        url = next(a for a in self.daemon.port_file.read_text().split() if a.startswith("https://"))
        out = subprocess.run(["curl", "-s", "-o", self.folder / "body", "-w", "%{http_code}", "-H", "Authorization: Bearer " + self.secret,
                              *map(str, arguments), url + "/metrics"], capture_output=True, timeout=60)
        return out.returncode, out.stdout.decode()


class Tls(Certificates):
    def test_tls_with_tokens(self):
        self.assertEqual(len(self.list_maps().maps), 0)
        self.assertEqual(self.curl("--cacert", self.authority.certificate), (0, "200"))
        self.refuses(grpc.StatusCode.UNAUTHENTICATED, lambda: self.list_maps(token="mct_wrong"))

    def test_strangers_and_plain_text(self):
        other = Authority(self.papers.name, "other")
        self.refuses(grpc.StatusCode.UNAVAILABLE, lambda: self.list_maps(authority=other))
        self.assertNotEqual(self.curl("--cacert", other.certificate)[0], 0)
        with grpc.insecure_channel(self.daemon.address) as channel:
            self.refuses(grpc.StatusCode.UNAVAILABLE, lambda: rpc.MapServiceStub(channel).ListMaps(
                pb.ListMapsRequest(), metadata=bearer(self.secret), timeout=8))
        for address in (self.daemon.address, self.https()):
            with socket.create_connection(self.split(address), timeout=10) as plain:
                plain.sendall(b"GET /healthz HTTP/1.1\r\n\r\n")
                try:
                    self.assertNotIn(b"200", plain.recv(1000))
                except ConnectionResetError:
                    pass  # also an answer
        self.assertEqual(self.curl("--cacert", self.authority.certificate)[1], "200")

    def https(self):
        return next(a for a in self.daemon.port_file.read_text().split() if a.startswith("https://")).split("//")[1]

    @staticmethod
    def split(address):
        host, port = address.rsplit(":", 1)
        return host, int(port)

    def test_old_protocols(self):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        warnings.simplefilter("ignore", DeprecationWarning)
        context.minimum_version = context.maximum_version = ssl.TLSVersion.TLSv1_1
        context.set_ciphers("ALL:@SECLEVEL=0")
        for address in (self.daemon.address, self.https()):
            with self.assertRaises((ssl.SSLError, ConnectionError)):
                with socket.create_connection(self.split(address), timeout=10) as raw, context.wrap_socket(raw):
                    pass

    def test_expired_server_certificate_does_not_start(self):
        expired = self.authority.sign("late", "20200101000000Z", "20200102000000Z")
        file = self.folder / "late.toml"
        file.write_text(self.tls_config(expired))
        for flag in ((), ("--check-config",)):
            out = subprocess.run([DAEMON, "--config", file, "--data", self.data, "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", *flag],
                                 capture_output=True, text=True, timeout=60)
            self.assertEqual(out.returncode, 2)
            self.assertIn("has expired", out.stderr)

    def test_slow_handshakes_do_not_stall(self):
        silent = [socket.create_connection(self.split(self.https()), timeout=10) for _ in range(200)]
        for s in silent:
            s.sendall(b"\x16\x03\x01")  # the beginning of a hello
        self.assertEqual(self.curl("--cacert", self.authority.certificate), (0, "200"))
        for s in silent:
            s.close()


class MutualTls(Certificates):
    client_ca = True

    def test_only_clients_with_a_good_certificate(self):
        good = self.authority.sign("robot")
        expired = self.authority.sign("late", "20200101000000Z", "20200102000000Z")
        early = self.authority.sign("early", "20980101000000Z", "20990101000000Z")
        stranger = Authority(self.papers.name, "other").sign("stranger")
        self.assertEqual(len(self.list_maps(good).maps), 0)
        ca = ("--cacert", self.authority.certificate)
        self.assertEqual(self.curl(*ca, "--cert", good[0], "--key", good[1]), (0, "200"))
        for name, identity in (("none", None), ("expired", expired), ("early", early), ("stranger", stranger)):
            with self.subTest(certificate=name):
                self.refuses(grpc.StatusCode.UNAVAILABLE, lambda i=identity: self.list_maps(i))
                paper = ("--cert", identity[0], "--key", identity[1]) if identity else ()
                self.assertNotEqual(self.curl(*ca, *paper)[1], "200")
        # A certificate opens the connection; rights come from tokens.
        self.refuses(grpc.StatusCode.UNAUTHENTICATED, lambda: self.list_maps(good, "mct_wrong"))


class Frames:
    """HTTP/2 by hand, for what gRPC's own clients would not send."""

    METHOD = b"/mapcodec.v1.MapService/"

    def __init__(self, address, preface=True):
        host, port = address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), timeout=20)
        if preface:
            self.socket.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + self.frame(4, 0, 0, b""))

    @staticmethod
    def frame(kind, flags, stream, payload):
        return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload

    def call(self, method, stream=1):
        pairs = [(b":method", b"POST"), (b":scheme", b"http"), (b":path", self.METHOD + method), (b":authority", b"x"),
                 (b"te", b"trailers"), (b"content-type", b"application/grpc")]
        block = b"".join(b"\0" + bytes([len(n)]) + n + bytes([len(v)]) + v for n, v in pairs)
        self.socket.sendall(self.frame(1, 4, stream, block))

    def data(self, payload, stream=1, end=False):
        self.socket.sendall(self.frame(0, 1 if end else 0, stream, payload))

    def everything(self, seconds=10):
        """What comes until the other side closes or the time is over."""
        self.socket.settimeout(seconds)
        out = b""
        try:
            while part := self.socket.recv(65536):
                out += part
        except (TimeoutError, ConnectionError):
            pass
        return out


def mutated(rng, seed):
    """Some bytes of `seed` changed, its end cut off or lengthened."""
    raw = bytearray(seed)
    for _ in range(rng.randrange(6)):
        raw[rng.randrange(len(raw))] = rng.randrange(256)
    if rng.random() < 0.3:
        raw = raw[:rng.randrange(len(raw) + 1)]
    if rng.random() < 0.3:
        raw += bytes(rng.randrange(256) for _ in range(rng.randrange(20)))
    return bytes(raw)


class TooMuch(SecureTest):
    config = '[http]\nmax_connections = 300\n[grpc]\nmax_connections = 400\nmemory_bytes = 67108864\nhandshake_s = 2.0\n[limits]\nrequests_per_s = 0.0\n'

    def rss(self):
        with open(f"/proc/{self.daemon.process.pid}/statm") as f:
            return int(f.read().split()[1]) * resource.getpagesize()

    def test_gigabyte_messages(self):
        self.create()
        before = self.rss()
        frames = Frames(self.daemon.address)
        frames.call(b"Stats")
        frames.data(struct.pack(">BI", 0, 1 << 30))  # "a gigabyte follows"
        frames.socket.settimeout(5)
        try:
            for _ in range(400 << 6):  # 400 MiB of it; the server stops reading, or cuts it off
                frames.data(bytes(16384))
        except OSError:
            pass
        frames.socket.close()
        big = pb.InsertRequest(scan=pb.InsertScan(sequence=1, points=pb.Points(count=1, xyz_f32=bytes(40 << 20))))
        self.refuses(grpc.StatusCode.RESOURCE_EXHAUSTED,
                     lambda: list(self.stub.Insert(iter([opening("m"), big]), timeout=60)), "larger than max")
        host, port = next(a for a in self.daemon.port_file.read_text().split() if "http" in a).split("//")[1].split(":")
        with socket.create_connection((host, int(port)), timeout=20) as s:
            s.sendall(b"POST /maps/m/index HTTP/1.1\r\nContent-Length: 1073741824\r\n\r\n")
            self.assertIn(b" 405 ", s.recv(4096))
        self.assertLess(self.rss() - before, memory_factor() * (200 << 20))
        self.stub.Stats(pb.StatsRequest(map="m"), timeout=20)

    def test_slow_loris(self):
        host, port = next(a for a in self.daemon.port_file.read_text().split() if "http" in a).split("//")[1].split(":")
        slow = [socket.create_connection((host, int(port)), timeout=20) for _ in range(150)]
        halves = [Frames(self.daemon.address, preface=False) for _ in range(50)]
        stop = threading.Event()

        def trickle():
            while not stop.wait(0.3):
                for s in slow + [h.socket for h in halves]:
                    try:
                        s.send(b"P")
                    except OSError:
                        pass

        thread = threading.Thread(target=trickle)
        thread.start()
        try:
            time.sleep(1)
            for _ in range(5):
                self.assertEqual(self.http_status("/healthz"), 200)
                self.stub.ListMaps(pb.ListMapsRequest(), timeout=20)
            ended = 0
            for s in slow + [h.socket for h in halves]:
                s.settimeout(20)
                try:
                    while s.recv(1000):
                        pass
                    ended += 1
                except ConnectionError:
                    ended += 1
                except TimeoutError:
                    pass
            self.assertEqual(ended, 200)  # although a byte came every 0.3 s
        finally:
            stop.set()
            thread.join()
        # A stream of gRPC that is opened and then says nothing costs a stream, and no thread.
        self.create()
        silent = [Frames(self.daemon.address) for _ in range(50)]
        for s in silent:
            s.call(b"Insert")
        self.stub.Stats(pb.StatsRequest(map="m"), timeout=20)

    def test_many_connections(self):
        """They are bounded, honest clients are served meanwhile, and all is as before afterwards."""
        files = f"/proc/{self.daemon.process.pid}/fd"
        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        count = min(CONNECTIONS, limit - 200)
        before = len(os.listdir(files))
        self.stub.ListMaps(pb.ListMapsRequest(), timeout=30)
        for kind in ("http", "grpc"):
            address = self.daemon.address if kind == "grpc" else next(
                a for a in self.daemon.port_file.read_text().split() if "http" in a).split("//")[1]
            host, port = address.split(":")
            held = []
            end = time.monotonic() + 120  # stops by itself
            try:
                while len(held) < count and time.monotonic() < end:
                    held.append(socket.create_connection((host, int(port)), timeout=20))
                self.assertEqual(len(held), count)
                self.assertLess(len(os.listdir(files)), before + (340 if kind == "http" else 440))
                self.assertEqual(self.http_status("/healthz"), 200)
                self.stub.ListMaps(pb.ListMapsRequest(), timeout=30)  # by a connection that it had before
                if kind == "grpc":
                    for _ in range(200):  # they said nothing: after the time for a handshake they are gone
                        if len(os.listdir(files)) < before + 100:
                            break
                        time.sleep(0.1)
                    self.assertLess(len(os.listdir(files)), before + 100)
            finally:
                for s in held:
                    s.close()
        for _ in range(100):
            if len(os.listdir(files)) <= before + 10:
                break
            time.sleep(0.1)
        self.assertLessEqual(len(os.listdir(files)), before + 10)

    def test_no_more_files(self):
        """A process that has no more files for connections is well again as soon as it has."""
        resource.prlimit(self.daemon.process.pid, resource.RLIMIT_NOFILE, (len(os.listdir(f"/proc/{self.daemon.process.pid}/fd")) + 60,) * 2)
        held = [Frames(self.daemon.address) for _ in range(200)]
        for frames in held:
            frames.socket.close()
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 100))])

    def test_malformed_protobuf(self):
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 100))])
        pose = pb.Pose(translation=pb.Vector(x=1), qw=1)
        seeds = [pb.GetTilesRequest(map="m", box=pb.Box(min=pb.Vector(x=1), max=pb.Vector(x=2))),
                 pb.GetTilesRequest(map="m", pose=pose, radius=3, coarse_level=3, if_none_match=bytes(16), have_segments=bytes(32)),
                 pb.GetTilesRequest(map="m", keys=[pb.TileKey(x=1), pb.TileKey(y=-1, level=2)]), pb.StatsRequest(map="m"),
                 pb.DecodeRequest(map="m", level=2, origin=pb.Vector(x=1)), opening("m"), opening("m", "robot", 1), scan(1, scan_of(2, 10)),
                 scan(2, scan_of(3, 4), submap="s", T_map_submap=pose, T_submap_scan=pose),
                 pb.SetPosesRequest(map="m", poses=[pb.SetPosesRequest.SubmapPose(submap="s", T_map_submap=pose)]),
                 pb.DiffRequest(map="m", **{"from": "1", "to": "2"}), pb.CreateMapRequest(map="n", promise_m=0.1)]
        seeds = [seed.SerializeToString() for seed in seeds]
        methods = [m.name for m in pb.DESCRIPTOR.services_by_name["MapService"].methods if m.name not in ("Watch", "DeleteMap")]
        channel = self.daemon.channel()
        rng = random.Random(5)
        end, rounds = time.monotonic() + FUZZ_SECONDS, 0
        while rounds < 150 or time.monotonic() < end:
            rounds += 1
            messages = [mutated(rng, rng.choice(seeds)) for _ in range(rng.randrange(1, 4))]
            call = channel.stream_stream(f"/mapcodec.v1.MapService/{rng.choice(methods)}", lambda b: b, lambda b: b)
            try:
                for _ in call(iter(messages), timeout=20):
                    pass
            except grpc.RpcError as e:
                self.assertNotIn(e.code(), (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL), (messages, e.details()))
        if FUZZ_SECONDS:
            print(f"{rounds} calls with malformed messages")
        channel.close()
        self.assertEqual(self.daemon.process.poll(), None)
        self.stub.ListMaps(pb.ListMapsRequest(), timeout=20)


class Limits(SecureTest):
    config = ("[limits]\nrequests_per_s = 0.01\nrequest_burst = 20.0\nopen_streams = 3\n"
              "bytes_per_s = 0.0\nbyte_burst = 0.0\n")

    def test_rate(self):
        codes = [self.http_status("/maps/x/index") for _ in range(30)]
        self.assertEqual((codes.count(404), codes.count(429)), (20, 10))
        error = self.refuses(grpc.StatusCode.RESOURCE_EXHAUSTED, lambda: self.stub.ListMaps(pb.ListMapsRequest(), timeout=20), "too many requests")
        self.assertIn("retry-after-ms", dict(error.trailing_metadata()))

    def test_open_streams(self):
        self.create()
        streams = [self.stub.Watch(pb.WatchRequest(map="m"), timeout=60) for _ in range(3)]
        for s in streams:
            next(s)
        self.refuses(grpc.StatusCode.RESOURCE_EXHAUSTED, lambda: self.stub.Watch(pb.WatchRequest(map="m"), timeout=20), "streams")
        streams[0].cancel()
        for _ in range(100):
            try:
                next(self.stub.Watch(pb.WatchRequest(map="m"), timeout=20))
                return
            except grpc.RpcError as e:
                self.assertEqual(e.code(), grpc.StatusCode.RESOURCE_EXHAUSTED)
                if "streams" not in e.details():
                    return  # the rate has come in between: the stream's place was free
                time.sleep(0.05)
        self.fail("the place of a stream that has ended was not given back")


class ByteLimit(SecureTest):
    config = "[limits]\nbytes_per_s = 10.0\nbyte_burst = 20000.0\n"

    def test_bytes(self):
        self.create()
        big = [scan(1, scan_of(1, 5000))]
        insert(self.stub, "m", big)  # 60 kB: goes below zero
        self.refuses(grpc.StatusCode.RESOURCE_EXHAUSTED, lambda: fetch(self.stub, map="m"), "too many bytes")
        self.assertEqual(self.http_status("/maps/m/index"), 429)


class Lies(SecureTest):
    config = ""

    def test_tiles_whose_checksum_lies(self):
        self.create(tile_size=5)
        insert(self.stub, "m", [scan(1, scan_of(1, 3000))])
        _, tiles = fetch(self.stub, map="m")
        archive = self.data / "m.mapc"
        self.assertEqual(self.daemon.stop(), 0)
        raw = bytearray(archive.read_bytes())
        victim = tiles[3][1]
        at = raw.find(victim)
        self.assertGreater(at, 0)
        raw[at + len(victim) // 2] ^= 1
        archive.write_bytes(raw)
        self.start()
        error = self.refuses(grpc.StatusCode.DATA_LOSS, lambda: fetch(self.stub, map="m"))
        self.assertEqual(dict(error.trailing_metadata())["mapcodec-error"], "ChecksumMismatch")
        key = tiles[3][0].key
        self.assertEqual(self.http_status(f"/maps/m/tiles/{key.level}_{key.x}_{key.y}_{key.z}"), 500)
        other = tiles[4][0].key
        self.assertEqual(self.http_status(f"/maps/m/tiles/{other.level}_{other.x}_{other.y}_{other.z}"), 200)
        # Nor is such an archive taken in.
        chunks = [pb.UploadRequest(map="copy")] + [pb.UploadRequest(data=bytes(raw[i:i + 100000])) for i in range(0, len(raw), 100000)]
        self.refuses(grpc.StatusCode.DATA_LOSS, lambda: self.stub.Upload(iter(chunks), timeout=60))
        self.assertEqual(self.files(), ["m.mapc"])


if __name__ == "__main__":
    unittest.main()

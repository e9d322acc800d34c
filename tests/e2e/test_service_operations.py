# SPDX-License-Identifier: GPL-3.0-or-later
"""Configuration, token verbs, logs, notices to systemd, backup while running."""
import json
import os
import re
import shutil
import socket
import subprocess
import threading
import unittest
from pathlib import Path

from daemon import DAEMON, Daemon, DaemonTest, fetch, insert, pb, scan, scan_of


def run(*arguments):
    return subprocess.run([DAEMON, *map(str, arguments)], capture_output=True, text=True, timeout=60)


class Configuration(DaemonTest):
    def test_defaults_go_out_and_come_back(self):
        printed = run("--print-config")
        self.assertEqual(printed.returncode, 0)
        file = self.folder / "c.toml"
        file.write_text(printed.stdout)
        self.assertEqual(run("--config", file, "--print-config").stdout, printed.stdout)
        self.assertEqual(run("--config", file, "--data", self.data, "--check-config").returncode, 0)
        by_python = __import__("tomllib").loads(printed.stdout)
        self.assertEqual(by_python["http"]["workers"], 64)
        self.assertEqual(by_python["http"]["read_timeout_s"], 2.0)

    def test_mistakes_are_one_line(self):
        file = self.folder / "c.toml"
        for text, says in (("[http]\nworker = 1\n", "unknown key 'http.worker'"), ("[http\n", "line 1"), ("[http]\nworkers = 0\n", "range")):
            file.write_text(text)
            out = run("--config", file, "--data", self.data)
            self.assertIn(out.returncode, (2, 3))
            self.assertRegex(out.stderr, rf"\Amapcodecd: {re.escape(str(file))}: [^\n]*{re.escape(says)}[^\n]*\n\Z")
        self.assertEqual(run("--config", self.folder / "missing.toml").returncode, 3)

    def test_token_verbs(self):
        for bad in (("a",), ("a", "--map", "m"), ("a", "--map", "m:root"), ("a", "--map", "../m:read"), ("a b", "--map", "m:read"),
                    ("a", "--map", "m:read", "--expires", "soon")):
            self.assertEqual(run("token", "add", "--data", self.data, *bad).returncode, 2, bad)
        made = run("token", "add", "a", "--data", self.data, "--map", "m:read", "--json")
        self.assertRegex(json.loads(made.stdout)["token"], "^mct_")
        self.assertEqual(run("token", "add", "a", "--data", self.data, "--map", "m:read").returncode, 2)
        self.assertEqual([t["grants"] for t in json.loads(run("token", "list", "--json", "--data", self.data).stdout)], [{"m": "read"}])
        self.assertEqual(run("token", "revoke", "a", "--data", self.data).returncode, 0)
        self.assertEqual(run("token", "revoke", "a", "--data", self.data).returncode, 3)


class Logs(DaemonTest):
    arguments = ("--log-json",)

    def test_json_lines_with_request_ids(self):
        self.create()
        self.stub.Stats(pb.StatsRequest(map="m"), metadata=[("x-request-id", "night-shift:7")], timeout=20)
        self.assertEqual(self.daemon.stop(), 0)
        lines = [json.loads(line) for line in self.daemon.said().splitlines()]
        self.assertTrue(all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$", line["time"]) for line in lines))
        mine = [line for line in lines if line.get("id") == "night-shift:7"]
        self.assertEqual([(m["transport"], m["method"], m["code"], m["principal"]) for m in mine], [("grpc", "Stats", "OK", "local")])


class Supervision(DaemonTest):
    def test_systemd_hears(self):
        path = self.folder / "notify"
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notices:
            notices.bind(str(path))
            notices.settimeout(20)
            environment = dict(os.environ, NOTIFY_SOCKET=str(path), WATCHDOG_USEC="200000")
            data = self.folder / "other"
            data.mkdir()
            daemon = Daemon(data, env=environment)
            self.addCleanup(daemon.kill)
            heard = [notices.recv(1000).decode() for _ in range(4)]
            self.assertIn("READY=1", heard[0])
            self.assertEqual(heard[1:], ["WATCHDOG=1"] * 3)
            self.assertEqual(daemon.stop(), 0)
            rest = ""
            while "STOPPING=1" not in rest:
                rest += notices.recv(1000).decode()


class Backup(DaemonTest):
    def test_copy_while_robots_write(self):
        self.create()
        stop = threading.Event()

        def robot():
            k = 0
            while not stop.is_set():
                k += 1
                insert(self.stub, "m", [scan(1, scan_of(k, 300))])

        thread = threading.Thread(target=robot)
        thread.start()
        try:
            for k in range(5):
                revision = self.stub.Snapshot(pb.SnapshotRequest(map="m", name=f"b{k}"), timeout=60).revision
                copy = Path(shutil.copy(self.data / "m.mapc", self.folder / f"copy{k}"))
                other = self.folder / f"restored{k}"
                other.mkdir()
                copy.rename(other / "m.mapc")
                restored = Daemon(other)
                self.addCleanup(restored.kill)
                with restored.channel() as channel:
                    facts, tiles = fetch(type(self.stub)(channel), map="m")
                self.assertGreaterEqual(facts.revision, revision)
                self.assertTrue(any(s.name == f"b{k}" for s in facts.snapshots))
                self.assertGreater(len(tiles), 0) if k else None
                self.assertEqual(restored.stop(), 0)
        finally:
            stop.set()
            thread.join()


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Every verb that takes MAP also takes mapcodec://HOST:PORT/MAP."""
import filecmp
import json
import unittest

from daemon import Daemon
from program import BAD_INPUT, USAGE, ProgramTest
from test_octrees import small_bt

UNREACHABLE = 6


def write_xyz(path, seed, count=3000):
    """Points that no other seed has, in text."""
    state = 12345 + seed
    lines = []
    for _ in range(3 * count):
        state = (1103515245 * state + 12345) % (1 << 31)
        lines.append(f"{(state >> 8) % 20000 / 1000 - 10:.3f}")
    path.write_text("\n".join(" ".join(lines[i:i + 3]) for i in range(0, len(lines), 3)) + "\n")
    return path


class Verbs(ProgramTest):
    def setUp(self):
        super().setUp()
        self.data = self.path("maps")
        self.data.mkdir()
        self.daemon = Daemon(self.data)
        self.addCleanup(self.daemon.kill)
        self.url = f"mapcodec://{self.daemon.address}/m"

    def json_of(self, *arguments):
        return self.succeeds(*arguments, "--json").json

    def begin(self):
        return self.json_of("update", self.url, write_xyz(self.path("a.xyz"), 1), "--create", "--max-error", "0.01")

    def test_a_map_lives_on_a_server(self):
        made = self.begin()
        self.assertEqual(made["points_in"], 3000)
        info = self.json_of("info", self.url)
        self.assertEqual((info["points"], info["promise"]["kind"]), (3000, "max_error"))
        self.assertEqual(info, self.json_of("info", self.data / "m.mapc"))
        self.json_of("update", self.url, write_xyz(self.path("b.xyz"), 2), "--submap", "b", "--pose", "5,0,0,0,0,0,1")
        self.assertEqual(self.json_of("info", self.url)["submaps"], 2)
        self.json_of("pose", self.url, "--submap", "b", "--pose", "6,0,0,0,0,0,1")
        self.succeeds("verify", self.url)
        self.succeeds("log", self.url)
        named = self.json_of("snapshot", self.url, "two")
        self.assertEqual(named["snapshot_revision"] + 1, named["revision"])
        self.json_of("remove", self.url, "--box=-99,-99,-99,0,99,99")
        self.assertLess(self.json_of("info", self.url)["points"], 6000)
        self.json_of("diff", self.url, "two", str(self.json_of("info", self.url)["revision"]))
        self.json_of("rollback", self.url, "two")
        self.assertEqual(self.json_of("info", self.url)["points"], 6000)
        out = self.path("out.pcd")
        self.succeeds("decompress", self.url, "-o", out, "--box", "0,0,0,5,5,5")
        here = self.path("here.pcd")
        self.succeeds("decompress", self.data / "m.mapc", "-o", here, "--box", "0,0,0,5,5,5")
        self.assertTrue(filecmp.cmp(out, here, shallow=False))
        self.json_of("compact", self.url)
        self.succeeds("verify", self.url)
        self.succeeds("repair", self.url, "-o", self.path("saved.mapc"))

    def test_compress_and_merge_to_a_server(self):
        source = write_xyz(self.path("a.xyz"), 1)
        self.succeeds("compress", source, "-o", self.url, "--max-error", "0.01")
        self.succeeds("verify", self.url, "--against", source)
        self.succeeds("evaluate", source, self.url)
        other = self.path("other.mapc")
        self.succeeds("compress", write_xyz(self.path("b.xyz"), 2), "-o", other, "--max-error", "0.01")
        self.json_of("merge", self.url, other)
        self.assertGreater(self.json_of("info", self.url)["points"], 3000)

    def test_octrees_stay_at_home(self):
        self.begin()
        octree = self.path("a.bt")
        octree.write_bytes(small_bt())
        alone, beside = self.path("alone.mapc"), self.path("beside.mapc")
        self.succeeds("compress", octree, "-o", alone)
        self.succeeds("compress", write_xyz(self.path("b.xyz"), 2), "-o", beside, "--max-error", "0.01")
        self.succeeds("update", beside, octree)
        self.fails(BAD_INPUT, "merge", self.url, alone, says="octree alone")
        merged = self.json_of("merge", self.url, beside)
        self.assertEqual(merged["points_in"], 3000)
        self.assertIn("octree is left out", " ".join(merged["warnings"]))

    def test_sync_brings_a_copy_up_to_date(self):
        self.begin()
        copy = self.path("copy.mapc")
        first = json.loads(self.succeeds("sync", self.url, copy, "--json").out)
        self.assertEqual(first["bytes_fetched"], first["bytes_whole"])
        self.json_of("update", self.url, write_xyz(self.path("b.xyz"), 2, 10))
        second = json.loads(self.succeeds("sync", self.url, copy, "--json").out)
        self.assertLess(second["bytes_fetched"], second["bytes_whole"])
        self.succeeds("verify", copy)
        self.json_of("compact", self.url)
        self.succeeds("sync", self.url, copy)
        self.succeeds("compact", copy)
        self.assertEqual(self.daemon.stop(), 0)
        self.assertTrue(filecmp.cmp(copy, self.data / "m.mapc", shallow=False))

    def test_failures_are_one_line(self):
        self.begin()
        self.fails(BAD_INPUT, "info", self.url + "2", says="no map")
        self.fails(USAGE, "info", "mapcodec://nowhere", says="host:port")
        self.fails(USAGE, "update", self.url, self.path("a.xyz"), "--rms", "0.5", says="promise")
        address = self.daemon.address
        self.daemon.stop()
        for verb in (["info"], ["verify"], ["log"], ["compact"], ["rollback", "1"], ["snapshot", "s"]):
            self.fails(UNREACHABLE, verb[0], f"mapcodec://{address}/m", *verb[1:], env={"MAPCODEC_TIMEOUT": "2", "PATH": "/bin"})
        self.fails(UNREACHABLE, "update", self.url, self.path("a.xyz"), env={"MAPCODEC_TIMEOUT": "2", "PATH": "/bin"})


if __name__ == "__main__":
    unittest.main()

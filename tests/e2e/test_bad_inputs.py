# SPDX-License-Identifier: GPL-3.0-or-later
"""What the world gets wrong: each has one line and one exit code, and nothing is left behind."""
import struct
import unittest
import zipfile

from clouds import RGB, XYZ, Cloud, Nearest, pcd_bytes, ply_bytes, positions, read_pcd, room, to_float32, write
from program import BAD_INPUT, USAGE, ProgramTest, run

NAN, INF = float("nan"), float("inf")


class BadInputs(ProgramTest):
    def refuses(self, data, says=None, name="in.pcd", flags=()):
        """compress says what is wrong with the file and leaves nothing behind."""
        source = write(self.path(name), data)
        self.fails(BAD_INPUT, "compress", source, "-o", self.path("x.mapc"), *flags, names=source, says=says)
        self.assertEqual(self.listing(), [name])

    def accepts(self, data, *flags, name="in.pcd"):
        source = write(self.path(name), data)
        outcome = self.succeeds("compress", source, "-o", self.path("x.mapc"), "--force", *flags)
        return outcome, self.path("x.mapc")

    def test_missing_file(self):
        for verb in (("compress", "{}", "-o", self.path("x.mapc")), ("info", "{}"), ("verify", "{}"),
                     ("decompress", "{}", "-o", self.path("x.pcd"))):
            missing = self.path("missing.pcd")
            self.fails(BAD_INPUT, *(missing if a == "{}" else a for a in verb), names=missing, says="no such|not exist|not found|missing")
            self.assertEqual(self.listing(), [])

    def test_directory(self):
        folder = self.path("folder.pcd")
        folder.mkdir()
        for verb in (("compress", folder, "-o", self.path("x.mapc")), ("info", folder), ("verify", folder),
                     ("evaluate", folder, folder)):
            self.fails(BAD_INPUT, *verb, names=folder, says="director|folder")

    def test_empty_file(self):
        for name in ("in.pcd", "in.ply", "in.xyz", "in.las", "in.bin"):
            self.refuses(b"", says="empty|no point", name=name)
            self.path(name).unlink()

    def test_header_without_points(self):
        self.refuses(pcd_bytes(Cloud(XYZ, [])), says="no point|empty|0 points")
        self.refuses(ply_bytes(Cloud(XYZ, [])), says="no point|empty|0 points")

    def test_truncated_body(self):
        whole = pcd_bytes(room(100))
        ply = ply_bytes(room(100))
        for cut in (1, 13, 500, 1999):
            self.refuses(whole[:-cut], says="truncat|ends|short|announces|expected")
            self.refuses(ply[:-cut], says="truncat|ends|short|announces|expected")

    def test_truncated_header(self):
        whole = pcd_bytes(room(10))
        for cut in range(1, whole.index(b"DATA"), 7):
            self.refuses(whole[:cut])

    def test_header_announces_more_points(self):
        for data in ("binary", "ascii"):
            self.refuses(pcd_bytes(room(100), data=data, points=101, width=101))
        self.refuses(pcd_bytes(room(100), points=10 ** 18, width=10 ** 18))
        self.refuses(ply_bytes(room(100), count=4 * 10 ** 9))

    def test_header_announces_fewer_points(self):
        # Some writers pad their files, so this may pass, but never in silence.
        for data in (pcd_bytes(room(100), points=90, width=90), pcd_bytes(room(100), data="ascii", points=90, width=90)):
            source = write(self.path("in.pcd"), data)
            outcome = run("compress", source, "-o", self.path("x.mapc"), "--force")
            self.assertIn(outcome.code, (0, BAD_INPUT), outcome)
            self.assertIn(str(source), outcome.err)
            self.assertRegex(outcome.err, r"\A[^\n]+\n\Z")

    def test_points_and_width_disagree(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(100), width=50))
        outcome = run("compress", source, "-o", self.path("x.mapc"), "--force")
        self.assertIn(outcome.code, (0, BAD_INPUT), outcome)
        self.assertIn(str(source), outcome.err)

    def test_negative_and_textual_counts(self):
        for count in (b"-5", b"many", b"1e3x", b"99999999999999999999999"):
            self.refuses(pcd_bytes(room(100)).replace(b"POINTS 100", b"POINTS " + count).replace(b"WIDTH 100", b"WIDTH " + count))

    def test_fields_that_make_no_sense(self):
        good = pcd_bytes(room(10))
        for old, new in ((b"FIELDS x y z", b"FIELDS x y w"), (b"SIZE 4 4", b"SIZE 4 3"), (b"TYPE F F", b"TYPE F Q"),
                         (b"COUNT 1 1", b"COUNT 1 0"), (b"COUNT 1 1", b"COUNT 1 -1"), (b"COUNT 1 1 ", b"COUNT 1 "),
                         (b"DATA binary", b"DATA lzma"), (b"COUNT 1 1 1 1", b"COUNT 1 1 1 99999999")):
            self.assertIn(old, good)
            self.refuses(good.replace(old, new))

    def test_nan_and_infinite_points_are_dropped_aloud(self):
        good = room(50, RGB)
        bad = [(NAN, NAN, NAN, 0), (1.0, INF, 1.0, 0), (1.0, 1.0, -INF, 0)]
        outcome, archive = self.accepts(pcd_bytes(Cloud(RGB, good.rows + bad)), "--max-error", 0.001)
        self.assertRegex(outcome.err, r"\b3\b")
        self.assertRegex(outcome.err.lower(), "nan|finite")
        self.assertEqual(self.succeeds("info", archive, "--json").json["points"], 50)

    def test_nothing_but_nan(self):
        self.refuses(pcd_bytes(Cloud(XYZ, [(NAN, NAN, NAN)] * 20)), says="finite|nan|no point")

    def test_text_instead_of_numbers(self):
        self.refuses(pcd_bytes(Cloud(XYZ, [(1.0, 2.0, 3.0)]), data="ascii").replace(b"\n1 2 3", b"\none two three"), says="line|byte|number")
        self.path("in.pcd").unlink()
        self.refuses(b"1 2 3\n4 5 six\n7 8 9\n", name="in.xyz", says="line|byte|number")
        self.path("in.xyz").unlink()
        self.refuses(b"Dear reader,\nthis is a letter and no scan.\n", name="letter.xyz")
        self.path("letter.xyz").unlink()
        self.refuses(bytes(range(256)) * 4, name="noise.dat")

    def test_a_missing_column_in_the_middle(self):
        self.refuses(b"1 2 3\n4 5\n7 8 9\n", name="in.xyz", says="line|byte|column|value")

    def test_formats_known_but_not_read(self):
        with zipfile.ZipFile(self.path("z.zip"), "w") as file:
            file.writestr("a.xyz", "1 2 3\n")
        las = bytearray(b"LASF" + bytes(371))
        las[24:26] = b"\x01\x02"
        struct.pack_into("<HII", las, 94, 227, 375, 0)
        las[104] = 3 | 0x80  # the bit that marks LAZ
        for name, data, says in (("in.e57", b"ASTM-E57" + bytes(100), "e57"), ("in.laz", bytes(las), "laz"),
                                 ("in.zip", self.path("z.zip").read_bytes(), "zip"),
                                 ("in.pcd", b"\x1f\x8b\x08" + bytes(50), "gzip|zip|compressed")):
            if self.path("z.zip").exists():
                self.path("z.zip").unlink()
            self.refuses(data, says=f"(?=.*({says}))", name=name)
            self.path(name).unlink()

    def test_content_decides_and_not_the_name(self):
        outcome, archive = self.accepts(ply_bytes(room(200)), name="really_a_ply.pcd")
        self.assertEqual(self.succeeds("info", archive, "--json").json["points"], 200)

    def test_one_point(self):
        for flags in ((), ("--max-error", 0.001), ("--lossless",), ("--paper",), ("--lossless", "--keep-order")):
            _, archive = self.accepts(pcd_bytes(Cloud(RGB, [(1.5, -2.25, 3.0, 0x102030)])), *flags)
            rows = read_pcd(self.decompress(archive)).rows
            self.assertEqual(len(rows), 1, flags)
            self.assertLess(max(abs(a - b) for a, b in zip(rows[0], (1.5, -2.25, 3.0))), 0.02)
            self.succeeds("verify", archive, "--against", self.path("in.pcd"))

    def test_all_points_equal(self):
        for flags in ((), ("--max-error", 0.001), ("--lossless",), ("--paper",)):
            _, archive = self.accepts(pcd_bytes(Cloud(RGB, [(1.5, -2.25, 3.0, 0x102030)] * 3000)), *flags)
            self.assertEqual(self.succeeds("info", archive, "--json").json["points"], 3000)
            rows = read_pcd(self.decompress(archive)).rows
            self.assertEqual(len(rows), 3000, flags)
            self.assertLess(max(abs(a - b) for r in rows for a, b in zip(r, (1.5, -2.25, 3.0))), 0.02)

    def test_points_on_a_line(self):
        rows = [(to_float32(i * 0.01), 0.0, 0.0) for i in range(2000)]
        for flags in ((), ("--lossless",), ("--paper",)):
            _, archive = self.accepts(pcd_bytes(Cloud(XYZ, rows)), *flags)
            self.succeeds("verify", archive)

    def test_a_million_metres_in_float32_warns(self):
        data = pcd_bytes(room(500, XYZ, offset=(1e6, 4e6, 0)))
        for flags in ((), ("--lossless",)):
            outcome, archive = self.accepts(data, *flags)
            self.assertRegex(outcome.err.lower(), "float32")
            self.succeeds("verify", archive, "--against", self.path("in.pcd"))
        # Also with a bound far below what float32 resolves there.
        for bound in (0.005, 0.05, 0.3):
            _, archive = self.accepts(data, "--max-error", bound)
            self.succeeds("verify", archive, "--against", self.path("in.pcd"))

    def test_a_million_metres_in_double_keeps_the_bound(self):
        fields = (("x", "d"), ("y", "d"), ("z", "d"))
        cloud = room(2000, fields, offset=(1e6, 4e6, 0))
        outcome, archive = self.accepts(ply_bytes(cloud), "--max-error", 0.001, name="utm.ply")
        self.assertEqual(outcome.err.count("float"), 0, outcome)
        self.succeeds("verify", archive, "--against", self.path("utm.ply"))
        decoded = positions(read_pcd(self.decompress(archive)))
        index = Nearest(decoded, 0.01)
        self.assertEqual(len(decoded), 2000)
        self.assertLessEqual(max(index.axis_error(p) for p in cloud.rows), 0.001 + 1e-9)

    def test_points_very_far_apart(self):
        rows = [(-3e8, 0.0, 0.0), (3e8, 1.0, 1.0), (0.0, 0.0, 3e8)]
        source = write(self.path("in.pcd"), pcd_bytes(Cloud((("x", "d"), ("y", "d"), ("z", "d")), rows)))
        outcome = run("compress", source, "-o", self.path("x.mapc"), "--max-error", 0.001)
        self.assertIn(outcome.code, (0, BAD_INPUT), outcome)
        if outcome.code == 0:
            self.succeeds("verify", self.path("x.mapc"), "--against", source)

    def test_not_an_archive(self):
        for data in (b"", b"MAP", pcd_bytes(room(100)), bytes(1000)):
            other = write(self.path("no.mapc"), data)
            for verb in (("info", other), ("verify", other), ("decompress", other, "-o", self.path("x.pcd"))):
                self.fails(BAD_INPUT, *verb, names=other)
        self.assertEqual(self.listing(), ["no.mapc"])

    def test_one_bad_input_among_good_ones(self):
        good = write(self.path("good.pcd"), pcd_bytes(room(100)))
        bad = write(self.path("bad.pcd"), pcd_bytes(room(100))[:-7])
        self.fails(BAD_INPUT, "compress", good, bad, "-o", self.path("x.mapc"), names=bad)
        self.assertEqual(self.listing(), ["bad.pcd", "good.pcd"])

    def test_usage(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(100)))
        out = self.path("x.mapc")
        archive = self.compress(source, name="good.mapc")
        for arguments in ((), ("squash",), ("compress",), ("compress", source), ("compress", source, "-o", out, "--rms", "-1"),
                          ("compress", source, "-o", out, "--rms", "soft"), ("compress", source, "-o", out, "--rms", "nan"),
                          ("compress", source, "-o", out, "--rms", "0.01", "--lossless"), ("compress", source, "-o", out, "--max-error", "0"),
                          ("compress", source, "-o", out, "--effort", "heroic"), ("compress", source, "-o", out, "--threads", "-1"),
                          ("compress", source, "-o", out, "--tile-size", "-2"), ("compress", source, "-o", out, "--max-memory", "lots"),
                          ("compress", source, "-o", out, "--no-such-flag"), ("decompress", archive), ("info",),
                          ("decompress", archive, "-o", self.path("x.docx")), ("decompress", archive, "-o", self.path("x")),
                          ("decompress", archive, "-o", self.path("x.pcd"), "--box", "1,2,3"),
                          ("decompress", archive, "-o", self.path("x.pcd"), "--box", "2,2,2,1,1,1"),
                          ("decompress", archive, "-o", self.path("x.pcd"), "--sphere", "0,0,0,-1"),
                          ("decompress", archive, "-o", self.path("x.pcd"), "--box", "a,b,c,d,e,f")):
            self.fails(USAGE, *arguments)
        for flag in ("--max-error", "--rms", "--target-bpp", "--target-ratio", "--tile-size", "--unit", "--color-error"):
            self.fails(USAGE, "compress", source, "-o", out, flag, "nan", says="number")
            self.fails(USAGE, "compress", source, "-o", out, flag, "inf")
        for flag in ("--distance", "--alpha", "--rel-area", "--outlier-radius", "--perc-process", "--outside-density"):
            self.fails(USAGE, "compress", source, "-o", out, "--paper", flag, "nan", says="number")
        self.fails(USAGE, "compress", source, "-o", out, "--channels", "no_such_channel", "--max-error", 0.01)
        self.assertEqual(self.listing(), ["good.mapc", "in.pcd"])


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: GPL-3.0-or-later
"""MRPT's files through the program, beside what MRPT itself makes of them. Files: what make_mrpt_logs writes, and
those of Debian's mrpt-common where it is installed."""
import gzip
import json
import math
import os
import shutil
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

MAPCODEC, PEER, MAKE = os.environ["MAPCODEC"], os.environ["MRPT_PEER"], os.environ["MAKE_MRPT_LOGS"]
SHIPPED = Path("/usr/share/mrpt/datasets")


def run(*arguments, code=0):
    p = subprocess.run([MAPCODEC, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert p.returncode == code, f"exit {p.returncode} instead of {code}: {arguments}\n{p.stdout[-500:]}{p.stderr[-2000:]}"
    if code:
        lines = [l for l in p.stderr.splitlines() if not l.startswith("mapcodec: note:")]
        assert len(lines) == 1 and lines[0].startswith("mapcodec: "), p.stderr
        return lines[0]
    return p.stdout


def peer(*arguments):
    p = subprocess.run([PEER, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert p.returncode == 0, p.stderr
    return json.loads(p.stdout.splitlines()[-1])


class Mrpt(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="mapcodec_mrpt_"))
        cls.logs = cls.folder / "logs"
        subprocess.run([MAKE, str(cls.logs)], check=True, timeout=120, stdout=subprocess.DEVNULL)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def path(self, name):
        return self.folder / name

    def points(self, map_path, name="out.xyz"):
        """Decoded rows of numbers, sorted."""
        out = self.path(name)
        run("decompress", map_path, "-o", out, "--force")
        return sorted(tuple(map(float, l.split())) for l in out.read_text().splitlines() if l[0] not in "#/x")

    def assert_like_mrpt(self, log, info, own, tolerance=2e-3):
        self.assertEqual(info["points"], own["points"], log)
        for a, b in zip(info["bounds"]["min"] + info["bounds"]["max"], own["min"] + own["max"]):
            self.assertLess(abs(a - b), tolerance + 1e-3 * abs(b), (log, info["bounds"], own))

    def test_counts_and_bounds_are_mrpts(self):
        names = ["depth.rawlog", "truth.rawlog", "external.rawlog", "frames.rawlog", "two_sensors.rawlog", "keyframes.simplemap",
                 "simple.mrpt", "colored.mrpt", "shining.mrpt", "weighted.mrpt", "many.mrpt"]
        files = [self.logs / n for n in names]
        shipped = ["test_velodyne_VLP16.rawlog", "tests_rgbd.rawlog", "localization_demo.rawlog", "rot_scan_2d.rawlog",
                   "malaga-cs-fac-building.simplemap.gz", "localization_demo.simplemap.gz"]
        files += [SHIPPED / n for n in shipped if (SHIPPED / n).exists() and n != "rot_scan_2d.rawlog"]
        for file in files:
            with self.subTest(file=file.name):
                out = self.path("counts.mapc")
                info = json.loads(run("compress", file, "-o", out, "--max-error", "0.001", "--channels", "none", "--json", "--force"))
                self.assert_like_mrpt(file.name, info, peer(file))
                run("verify", out, "--against", file)

    def test_colours_are_mrpts(self):
        run("compress", self.logs / "depth.rawlog", "-o", self.path("c.mapc"), "--lossless", "--channels", "rgb", "--force")
        peer(self.logs / "depth.rawlog", "--map", self.path("mrpt.xyz"))
        ours = self.points(self.path("c.mapc"))
        theirs = sorted(tuple(map(float, l.split())) for l in self.path("mrpt.xyz").read_text().splitlines())
        self.assertEqual(len(ours), len(theirs))
        self.assertEqual(sorted(p[3:6] for p in ours), sorted(p[3:6] for p in theirs))

    def test_images_beside_the_log(self):
        for name in ["depth", "external"]:
            run("compress", self.logs / f"{name}.rawlog", "-o", self.path(f"{name}.mapc"), "--lossless", "--force")
        self.assertEqual(self.points(self.path("depth.mapc"), "a.xyz"), self.points(self.path("external.mapc"), "b.xyz"))

    def test_unknown_classes_are_named_and_counted(self):
        p = subprocess.run([MAPCODEC, "compress", self.logs / "unknown.rawlog", "-o", self.path("u.mapc"), "--max-error", "0.01"],
                           capture_output=True, text=True, timeout=60)
        self.assertEqual(p.returncode, 0, p.stderr)
        self.assertIn("8 CObservationXYZ: not known to MRPT 2.5.8", p.stderr)
        self.assertEqual(json.loads(run("info", self.path("u.mapc"), "--json"))["points"], 4 * 361)

    def test_poses_from_every_kind_of_file(self):
        truth = None
        for poses in [self.logs / "poses.tum", self.logs / "poses.kitti", self.logs / "poses.txt", self.logs / "keyframes.simplemap"]:
            out = self.path("poses.mapc")
            j = json.loads(run("rawlog", self.logs / "no_poses.rawlog", "-o", out, "--poses", poses, "--lossless", "--force", "--json"))
            self.assertEqual((j["keyframes"], j["poses"]), (8, "file"))
            points = self.points(out)
            truth = truth or points
            self.assertEqual(len(points), len(truth))
            for a, b in zip(points, truth):
                self.assertLess(max(abs(x - y) for x, y in zip(a[:3], b[:3])), 1e-4, poses)

    def test_poses_of_the_log(self):
        trajectories = []
        for log, poses in [("truth.rawlog", "file"), ("truth.rawlog", "log"), ("depth.rawlog", "odometry")]:
            tum = self.path("way.tum")
            run("rawlog", self.logs / log, "-o", self.path("p.mapc"), "--poses", poses, "--force", "--trajectory", tum)
            trajectories.append([list(map(float, l.split())) for l in tum.read_text().splitlines()[1:]])
            self.assertEqual(len(trajectories[-1]), 8)
        for rows in zip(*trajectories):
            for a in rows[1:]:
                self.assertLess(max(abs(x - y) for x, y in zip(a[1:], rows[0][1:])), 1e-6)
        for code, log, flags, text in [(3, "no_poses.rawlog", [], "holds no poses"),
                                       (3, "no_poses.rawlog", ["--poses", "odometry"], "no odometry"),
                                       (3, "no_points.rawlog", [], "no observation with points"),
                                       (3, "newer.rawlog", [], "zstd"),
                                       (3, "depth.rawlog", ["--sensor", "nobody"], "no observation with points")]:
            self.assertIn(text, run("rawlog", self.logs / log, "-o", self.path("x.mapc"), *flags, code=code))
            self.assertFalse(self.path("x.mapc").exists())

    def test_sensors_are_chosen(self):
        for sensor, points in [("laser", 8 * 361), ("camera", 8 * 120 * 90)]:
            j = json.loads(run("rawlog", self.logs / "two_sensors.rawlog", "-o", self.path("s.mapc"), "--sensor", sensor, "--max-error",
                               "0.01", "--force", "--json"))
            self.assertEqual(j["points"], points)

    def test_decimation_and_keyframes(self):
        j = json.loads(run("rawlog", self.logs / "depth.rawlog", "-o", self.path("d.mapc"), "--decimation", "3", "--keyframe-distance",
                           "0.25", "--force", "--json"))
        self.assertEqual((j["points"], j["keyframes"], j["thinned_out"]), (4 * 40 * 30, 4, 4) if j["keyframes"] == 4 else
                         (3 * 40 * 30, 3, 5))

    def registered(self, log, largest_m, *flags):
        tum = self.path("icp.tum")
        run("rawlog", self.logs / log, "-o", self.path("icp.mapc"), "--poses", "icp", "--force", "--trajectory", tum, *flags)
        rows = [list(map(float, l.split())) for l in tum.read_text().splitlines()[1:]]
        self.assertEqual(len(rows), 8)
        for i, row in enumerate(rows):
            self.assertLess(math.dist(row[1:4], (0.12 * i, 0.05 * i, 0)), largest_m, (i, row))

    def test_registration_of_depth_images(self):
        self.registered("no_poses.rawlog", 0.03)

    def test_registration_of_flat_scans(self):
        self.registered("frames.rawlog", 0.05, "--sensor", "laser")

    def test_a_jump_in_time_is_said(self):
        p = subprocess.run([MAPCODEC, "rawlog", self.logs / "jump.rawlog", "-o", self.path("jump.mapc"), "--max-error", "0.01"],
                           capture_output=True, text=True, timeout=60)
        self.assertEqual(p.returncode, 0, p.stderr)
        self.assertIn("time jumps by -", p.stderr)

    def test_a_corrected_pose_moves_its_keyframe(self):
        out = self.path("loop.mapc")
        run("rawlog", self.logs / "depth.rawlog", "-o", out, "--force")
        before = json.loads(run("info", out, "--json"))
        run("pose", out, "--submap", "kf000007", "--pose", "10,0,0,0,0,0,1")
        after = json.loads(run("info", out, "--json"))
        self.assertGreater(after["bounds"]["max"][0], before["bounds"]["max"][0] + 5)

    def test_simplemap_out_and_in_again(self):
        out = self.path("k.mapc")
        run("rawlog", self.logs / "depth.rawlog", "-o", out, "--max-error", "0.001", "--color-error", "0", "--force")
        for name in ["k.simplemap", "k.simplemap.gz"]:
            run("decompress", out, "-o", self.path(name), "--force")
            info = json.loads(run("info", out, "--json"))
            own = peer(self.path(name))
            self.assertEqual((own["points"], own["observations"]), (info["points"], 8))
            run("compress", self.path(name), "-o", self.path("again.mapc"), "--max-error", "0.001", "--color-error", "0", "--force")
            run("verify", self.path("again.mapc"), "--against", self.path(name))
            e = json.loads(run("evaluate", out, self.path("again.mapc"), "--json"))
            self.assertLess(e["max_m"], 0.004)
        self.assertIn("whole keyframes", run("decompress", out, "-o", self.path("no.simplemap"), "--box", "0,0,0,1,1,1", code=2))
        self.assertEqual(list(self.folder.glob("*.part*")), [])

    def test_an_interrupted_run_ends_with_the_same_map(self):
        whole, parts = self.path("whole.mapc"), self.path("parts.mapc")
        for poses in [["--poses", "odometry"], ["--poses", "icp"]]:
            log = self.logs / "depth.rawlog"
            flags = ["rawlog", log, "--max-error", "0.005", *poses]
            run(*flags, "-o", whole, "--force")
            parts.unlink(missing_ok=True)
            kills = 0
            for _ in range(30):
                p = subprocess.Popen([MAPCODEC, *map(str, flags), "-o", str(parts)], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
                size = parts.stat().st_size if parts.exists() else 0
                while p.poll() is None and not (parts.exists() and parts.stat().st_size > size):
                    time.sleep(0.002)
                if p.poll() is not None:
                    break
                p.send_signal(signal.SIGKILL)
                p.wait()
                p.stderr.close()
                kills += 1
                run("verify", parts)
            said = p.stderr.read().decode()  # the last kill may have come after the last commit
            self.assertTrue(p.wait() == 0 or "complete already" in said, said)
            p.stderr.close()
            self.assertGreater(kills, 0)
            self.assertEqual(self.points(parts, "a.xyz"), self.points(whole, "b.xyz"))
            a, b = (json.loads(run("info", m, "--json", "--tiles")) for m in (parts, whole))
            self.assertEqual(a["submaps"], b["submaps"])
            self.assertEqual(a["tile_list"], b["tile_list"])
            self.assertIn("complete already", run(*flags, "-o", parts, code=4))

    def test_a_cut_log_keeps_what_came_before(self):
        plain = self.path("plain.rawlog")
        data = gzip.decompress((self.logs / "depth.rawlog").read_bytes())
        plain.write_bytes(data[: len(data) * 11 // 16])
        line = run("rawlog", plain, "-o", self.path("cut.mapc"), "--max-error", "0.01", "--poses", "odometry", code=3)
        self.assertIn("ends within", line)
        self.assertIn("5 keyframes before it are in the map", line)
        run("verify", self.path("cut.mapc"))
        self.assertEqual(json.loads(run("info", self.path("cut.mapc"), "--json"))["points"], 5 * 120 * 90)
        run("compress", plain, "-o", self.path("cut2.mapc"), "--max-error", "0.01", code=3)

    def test_damaged_logs_and_simplemaps(self):
        """Cut and flipped: an error of one line, or a map; never a crash."""
        for name in ["depth.rawlog", "keyframes.simplemap", "frames.rawlog", "colored.mrpt"]:
            data = (self.logs / name).read_bytes()
            for i in range(6):
                broken = self.path("broken_" + name)
                cut = data[: len(data) * (i + 1) // 8] if i % 2 else bytearray(data)
                if i % 2 == 0:
                    cut[20 + len(data) * i // 7] ^= 0x55
                broken.write_bytes(cut)
                p = subprocess.run([MAPCODEC, "compress", broken, "-o", self.path("b.mapc"), "--max-error", "0.01", "--force"],
                                   capture_output=True, text=True, timeout=120)
                self.assertIn(p.returncode, (0, 3), p.stderr)
                if p.returncode:
                    self.assertTrue(p.stderr.splitlines()[-1].startswith(f"mapcodec: {broken}: "), p.stderr)

    def test_example_programs(self):
        out = self.path("example.mapc")
        run("rawlog", self.logs / "depth.rawlog", "-o", out, "--rms", "0.01", "--force")
        if "MRPT_PROGRAM" in os.environ:
            p = subprocess.run([os.environ["MRPT_PROGRAM"], out], capture_output=True, text=True, timeout=120)
            self.assertEqual(p.returncode, 0, p.stderr)
            said = {l.split()[0]: l.split()[1:] for l in p.stdout.splitlines()}
            self.assertEqual(int(said["points"][0]), 8 * 120 * 90)
            self.assertGreater(float(said["likelihood"][0]), float(said["likelihood_beside"][0]))
            self.assertLess(float(said["icp_off_m"][0]), 0.05)
        if "PCL_PROGRAM" in os.environ:
            p = subprocess.run([os.environ["PCL_PROGRAM"], out, "0", "-4", "0", "6", "4", "3", self.path("pcl.mapc")],
                               capture_output=True, text=True, timeout=120)
            self.assertEqual(p.returncode, 0, p.stderr)
            said = {l.split()[0]: l.split()[1] for l in p.stdout.splitlines()}
            self.assertEqual(said["written"], said["thinned"])
            self.assertLess(float(said["nearest_m"]), 0.05)


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodecd through the eyes of a client that knows only the .proto."""
import struct
import threading
import unittest
import zlib

import grpc

from daemon import DaemonTest, fetch, insert, opening, pb, points, scan, scan_of
from grpc_health import health, health_rpc, reflection, reflection_rpc

NAN = float("nan")


class Maps(DaemonTest):
    def test_create_list_delete(self):
        self.create("one")
        self.create("two.b-3_x", promise=pb.CreateMapRequest.LOSSLESS, promise_m=0)
        names = [m.map for m in self.stub.ListMaps(pb.ListMapsRequest(), timeout=10).maps]
        self.assertEqual(names, ["one", "two.b-3_x"])
        self.refuses(grpc.StatusCode.ALREADY_EXISTS, lambda: self.create("one"))
        self.stub.DeleteMap(pb.DeleteMapRequest(map="one"), timeout=10)
        self.refuses(grpc.StatusCode.NOT_FOUND, lambda: self.stub.DeleteMap(pb.DeleteMapRequest(map="one"), timeout=10))
        self.assertEqual([p.name for p in self.data.glob("*.mapc")], ["two.b-3_x.mapc"])

    def test_names_make_no_paths(self):
        for name in ["", "..", ".", "../x", "a/b", "/etc/passwd", "a\0b", "-a", ".a", "a" * 101, "ä", "a b", "a\\b"]:
            self.refuses(grpc.StatusCode.INVALID_ARGUMENT, lambda n=name: self.create(n), "name")
        self.assertEqual(list(self.data.glob("*.mapc")), [])

    def test_promises_are_checked(self):
        bad = grpc.StatusCode.INVALID_ARGUMENT
        for fields in [{"promise_m": -1}, {"promise_m": NAN}, {"promise_m": 0}, {"tile_size": NAN}, {"tile_size": 1e30},
                       {"color_error": -1}, {"channels": [pb.Channel(name="", scalar=pb.U8, components=1)]},
                       {"channels": [pb.Channel(name="a", scalar=99, components=1)]}]:
            self.refuses(bad, lambda f=fields: self.create("m", **f))
        self.assertEqual(list(self.data.glob("*.mapc")), [])

    def test_restart_keeps_everything(self):
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 1000))])
        _, before = fetch(self.stub, map="m")
        self.assertEqual(self.daemon.stop(), 0, self.daemon.said())
        self.start()
        _, after = fetch(self.stub, map="m")
        self.assertEqual([t[1] for t in before], [t[1] for t in after])


class Insert(DaemonTest):
    def test_scans_are_acknowledged_and_come_back(self):
        self.create()
        packed = scan_of(1, 5000)
        sequence, revision = insert(self.stub, "m", [scan(1, packed)])
        self.assertEqual((sequence, revision), (1, 2))
        found = b"".join(r.points.xyz_f32 for r in self.stub.Decode(pb.DecodeRequest(map="m"), timeout=60))
        self.assertEqual(len(found), len(packed))
        want = sorted(struct.iter_unpack("<3f", packed))
        have = sorted(struct.iter_unpack("<3f", found))
        worst = max(abs(a - b) for w, h in zip(want, have) for a, b in zip(w[:1], h[:1]))
        self.assertLessEqual(worst, 0.0101)

    def test_many_clients_share_commits(self):
        self.create()
        acknowledged = []

        def client(k):
            scans = [scan(i + 1, scan_of(100 * k + i, 500)) for i in range(10)]
            acknowledged.append(insert(self.stub, "m", scans, writer=f"robot-{k}"))

        threads = [threading.Thread(target=client, args=(k,)) for k in range(4)]
        for t in threads:
            t.start()
        for t in threads:
            t.join()
        self.assertEqual([a[0] for a in acknowledged], [10] * 4)
        stats = self.stub.Stats(pb.StatsRequest(map="m"), timeout=10)
        self.assertEqual(stats.map.points, 4 * 10 * 500)
        self.assertLess(stats.map.revision, 41)

    def test_a_scan_that_comes_twice_counts_once(self):
        self.create(promise=pb.CreateMapRequest.LOSSLESS, promise_m=0)
        scans = [scan(i, scan_of(i, 100)) for i in (1, 2, 3)]
        insert(self.stub, "m", scans[:2], writer="r")
        replies = list(self.stub.Insert(iter([opening("m", "r"), *scans]), timeout=60))
        self.assertTrue(replies[0].opened)
        self.assertEqual(replies[0].sequence, 2)
        self.assertEqual(replies[-1].sequence, 3)
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 300)
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                     lambda: insert(self.stub, "m", [scan(9, scan_of(9, 10))], writer="r"), "missing")

    def test_scans_that_add_nothing_leave_no_gap(self):
        self.create()
        same = scan_of(1, 1000)
        for sequence in 1, 2, 3:  # each on its own: scans that share a commit are not compared with each other
            insert(self.stub, "m", [scan(sequence, same)], writer="r")
        self.daemon.stop()
        self.start()
        replies = list(self.stub.Insert(iter([opening("m", "r", acknowledged=3), scan(4, scan_of(2, 1000))]), timeout=60))
        self.assertEqual([r.sequence for r in replies], [3, 4])
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 2000)

    def test_submaps_and_poses(self):
        self.create()
        pose = pb.Pose(translation=pb.Vector(x=100), qw=1)
        moved = scan(1, struct.pack("<3f", 1, 2, 3), submap="a", T_map_submap=pose,
                     T_submap_scan=pb.Pose(translation=pb.Vector(y=10), qz=1))  # half a turn about z
        insert(self.stub, "m", [moved])
        decoded = list(self.stub.Decode(pb.DecodeRequest(map="m", f64=True), timeout=60))[-1]
        x, y, z = struct.unpack("<3d", decoded.points.xyz_f64)
        self.assertAlmostEqual(x, 99, delta=0.011)
        self.assertAlmostEqual(y, 8, delta=0.011)
        self.assertAlmostEqual(z, 3, delta=0.011)
        facts, _ = fetch(self.stub, map="m", without_bytes=True)
        self.assertEqual([s.name for s in facts.submaps], ["", "a"])
        change = pb.SetPosesRequest.SubmapPose(submap="a", T_map_submap=pb.Pose(translation=pb.Vector(z=7), qw=1))
        self.stub.SetPoses(pb.SetPosesRequest(map="m", poses=[change]), timeout=60)
        facts, _ = fetch(self.stub, map="m", without_bytes=True)
        self.assertEqual(facts.submaps[1].T_map_submap.translation.z, 7)

    def test_hostile_points_are_refused(self):
        self.create(channels=[pb.Channel(name="label", scalar=pb.U16, components=1)])
        label = [pb.Channel(name="label", scalar=pb.U16, components=1, data=b"\0\0")]
        one = struct.pack("<3f", 0, 0, 0)
        good = pb.Points(count=1, xyz_f32=one, channels=label)
        bad = [
            ("finite", pb.Points(count=1, xyz_f32=struct.pack("<3f", NAN, 0, 0), channels=label)),
            ("finite", pb.Points(count=1, xyz_f32=struct.pack("<3f", 0, float("inf"), 0), channels=label)),
            ("far", pb.Points(count=1, xyz_f64=struct.pack("<3d", 0, 1e300, 0), channels=label)),
            ("at most", pb.Points(count=1 << 62, xyz_f32=one, channels=label)),
            ("bytes of coordinates", pb.Points(count=2, xyz_f32=one, channels=label)),
            ("bytes of coordinates", pb.Points(count=1, xyz_f32=one[:11], channels=label)),
            ("not both", pb.Points(count=1, xyz_f32=one, xyz_f64=one + one, channels=label)),
            ("missing", pb.Points(count=1, xyz_f32=one)),
            ("has 1 bytes", pb.Points(count=1, xyz_f32=one,
                                      channels=[pb.Channel(name="label", scalar=pb.U16, components=1, data=b"\0")])),
            ("twice", pb.Points(count=1, xyz_f32=one, channels=label * 2)),
            ("no known type", pb.Points(count=1, xyz_f32=one,
                                        channels=[pb.Channel(name="label", scalar=77, components=1, data=b"\0\0")])),
            ("here", pb.Points(count=1, xyz_f32=one,
                               channels=[pb.Channel(name="label", scalar=pb.U8, components=1, data=b"\0")])),
        ]
        for says, p in bad:
            request = pb.InsertRequest(scan=pb.InsertScan(sequence=1, points=p))
            self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                         lambda r=request: self.stub.Insert(iter([opening("m"), r]), timeout=60), says)
        poses = [pb.Pose(qw=2), pb.Pose(translation=pb.Vector(x=NAN), qw=1), pb.Pose(qx=NAN)]
        for pose in poses:
            request = pb.InsertRequest(scan=pb.InsertScan(sequence=1, points=good, T_submap_scan=pose))
            self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                         lambda r=request: self.stub.Insert(iter([opening("m"), r]), timeout=60))
        spread = struct.pack("<300000d", *(float(1000 * (i % 3 + 1) * (i // 3)) for i in range(300000)))
        wide = pb.InsertRequest(scan=pb.InsertScan(sequence=1, points=pb.Points(
            count=100000, xyz_f64=spread, channels=[pb.Channel(name="label", scalar=pb.U16, components=1, data=bytes(200000))])))
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT, lambda: self.stub.Insert(iter([opening("m"), wide]), timeout=60), "tiles")
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 0)
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT, lambda: self.stub.Insert(iter([scan(1, one)]), timeout=60), "opens")
        self.refuses(grpc.StatusCode.NOT_FOUND, lambda: self.stub.Insert(iter([opening("none")]), timeout=60))

    def test_messages_have_a_limit(self):
        self.create()
        huge = scan(1, bytes(12 * 2000000))
        self.refuses(grpc.StatusCode.RESOURCE_EXHAUSTED, lambda: self.stub.Insert(iter([opening("m"), huge]), timeout=60))


class Tiles(DaemonTest):
    def setUp(self):
        super().setUp()
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 20000))])

    def test_selection(self):
        facts, everything = fetch(self.stub, map="m")
        self.assertEqual(facts.revision, 2)
        self.assertEqual(len(everything), 64)
        self.assertEqual(sum(t[0].points for t in everything), 20000)
        for tile, data in everything:
            self.assertEqual(sum(tile.segment_bytes), len(data))
            self.assertEqual(len(tile.hash), 16)
        key = everything[5][0].key
        _, one = fetch(self.stub, map="m", keys=[key])
        self.assertEqual([t[1] for t in one], [everything[5][1]])
        box = pb.Box(min=pb.Vector(x=1, y=1, z=1), max=pb.Vector(x=2, y=2, z=2))
        _, few = fetch(self.stub, map="m", box=box)
        self.assertEqual(len(few), 1)
        _, near = fetch(self.stub, map="m", pose=pb.Pose(translation=pb.Vector(x=5, y=5, z=5), qw=1), radius=3)
        self.assertEqual(len(near), 1)
        _, sphere = fetch(self.stub, map="m", sphere=pb.Sphere(centre=pb.Vector(x=5, y=5, z=5), radius=6))
        self.assertEqual(len(sphere), 7)
        self.assertEqual(sphere[0][0].key, near[0][0].key)  # the nearest first
        _, none = fetch(self.stub, map="m", keys=[pb.TileKey(x=1000)])
        self.assertEqual(none, [])

    def test_what_the_client_has_is_not_sent(self):
        _, everything = fetch(self.stub, map="m")
        have = b"".join(t[0].hash for t in everything[:60])
        _, again = fetch(self.stub, map="m", if_none_match=have)
        self.assertEqual(sum(t[0].not_modified for t in again), 60)
        self.assertEqual(sum(len(t[1]) > 0 for t in again), 4)
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                     lambda: self.stub.GetTiles(pb.GetTilesRequest(map="m", if_none_match=b"123"), timeout=9), "16")

    def test_limits_and_bad_requests(self):
        bad = grpc.StatusCode.INVALID_ARGUMENT
        size = 3000
        _, some = fetch(self.stub, map="m", max_bytes=size)
        self.assertLessEqual(sum(len(t[1]) for t in some), size)
        for request in [{"keys": [pb.TileKey(level=77)]}, {"sphere": pb.Sphere(radius=-1)}, {"sphere": pb.Sphere(radius=NAN)},
                        {"box": pb.Box(min=pb.Vector(x=NAN))}, {"box": pb.Box(min=pb.Vector(x=2))},
                        {"keys": [pb.TileKey()], "box": pb.Box()}]:
            self.refuses(bad, lambda r=request: self.stub.GetTiles(pb.GetTilesRequest(map="m", **r), timeout=9))
        self.refuses(grpc.StatusCode.NOT_FOUND, lambda: self.stub.GetTiles(pb.GetTilesRequest(map="m", revision="77"), timeout=9))

    def test_archive_as_it_lies(self):
        whole = b"".join(r.data for r in self.stub.ReadArchive(pb.ReadArchiveRequest(map="m"), timeout=60))
        self.assertEqual(whole, (self.data / "m.mapc").read_bytes())
        first = next(iter(self.stub.ReadArchive(pb.ReadArchiveRequest(map="m", length=1), timeout=60)))
        part = b"".join(r.data for r in self.stub.ReadArchive(
            pb.ReadArchiveRequest(map="m", file=first.file, offset=100, length=50), timeout=60))
        self.assertEqual(part, whole[100:150])
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                     lambda: self.stub.ReadArchive(pb.ReadArchiveRequest(map="m", offset=len(whole) + 1), timeout=9))
        self.refuses(grpc.StatusCode.NOT_FOUND,
                     lambda: self.stub.ReadArchive(pb.ReadArchiveRequest(map="m", file=999999), timeout=9))

    def upload(self, name, data):
        parts = [pb.UploadRequest(map=name, data=data[i:i + 10000]) for i in range(0, max(1, len(data)), 10000)]
        return self.stub.Upload(iter(parts), timeout=60)

    def test_uploads_are_verified(self):
        whole = (self.data / "m.mapc").read_bytes()
        self.assertEqual(self.upload("copy", whole).revision, 2)
        self.assertEqual((self.data / "copy.mapc").read_bytes(), whole)
        flipped = bytearray(whole)
        flipped[200] ^= 1
        self.refuses(grpc.StatusCode.DATA_LOSS, lambda: self.upload("bad", bytes(flipped)))
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT, lambda: self.upload("bad", b"no archive at all"))
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT, lambda: self.upload("../bad", whole))
        self.refuses(grpc.StatusCode.ALREADY_EXISTS, lambda: self.upload("copy", whole))
        self.assertEqual(sorted(p.name for p in self.data.glob("*.mapc")), ["copy.mapc", "m.mapc"])


class Revisions(DaemonTest):
    def test_watch_tells_changes_and_resumes(self):
        self.create()
        watch = self.stub.Watch(pb.WatchRequest(map="m"), timeout=60)
        events = iter(watch)
        first = next(events)
        self.assertTrue(first.complete and first.reset)
        self.assertEqual((first.revision, len(first.changes)), (1, 0))
        insert(self.stub, "m", [scan(1, scan_of(1, 2000, spread=5))])
        second = next(events)
        self.assertEqual(second.revision, 2)
        self.assertEqual({c.kind for c in second.changes}, {pb.TileChange.ADDED})
        insert(self.stub, "m", [scan(1, struct.pack("<3f", 1, 1, 1))])
        third = next(events)
        self.assertEqual([c.kind for c in third.changes], [pb.TileChange.CHANGED])
        watch.cancel()
        resumed = list(self.stub.Watch(pb.WatchRequest(map="m", since=2, once=True), timeout=60))
        self.assertEqual([c.hash for r in resumed for c in r.changes], [third.changes[0].hash])
        self.assertFalse(resumed[0].reset)
        gone = list(self.stub.Watch(pb.WatchRequest(map="m", since=99, once=True), timeout=60))
        self.assertTrue(gone[0].reset)
        again = self.stub.Watch(pb.WatchRequest(map="m", since=3), timeout=60)
        next(iter(again))
        self.stub.DeleteMap(pb.DeleteMapRequest(map="m"), timeout=60)
        self.refuses(grpc.StatusCode.NOT_FOUND, lambda: again)

    def test_snapshot_diff_rollback_compact_erase(self):
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 2000))])
        self.assertEqual(self.stub.Snapshot(pb.SnapshotRequest(map="m", name="before"), timeout=60).revision, 2)
        self.refuses(grpc.StatusCode.INVALID_ARGUMENT,
                     lambda: self.stub.Snapshot(pb.SnapshotRequest(map="m", name="before"), timeout=60))
        insert(self.stub, "m", [scan(1, scan_of(2, 2000))])
        diff = list(self.stub.Diff(pb.DiffRequest(map="m", **{"from": "before"}), timeout=60))
        self.assertGreater(sum(len(d.changes) for d in diff), 0)
        self.stub.Erase(pb.EraseRequest(map="m", box=pb.Box(min=pb.Vector(x=-99, y=-99, z=-99), max=pb.Vector(y=99, z=99))),
                        timeout=60)
        left = self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points
        self.assertGreater(left, 1500)
        self.assertLess(left, 2500)
        self.stub.Rollback(pb.RollbackRequest(map="m", revision="before"), timeout=60)
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 2000)
        report = self.stub.Compact(pb.CompactRequest(map="m", keep_last=1), timeout=60)
        self.assertLess(report.bytes_after, report.bytes_before)
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 2000)
        insert(self.stub, "m", [scan(1, scan_of(3, 100))])

    def test_a_reader_goes_on_while_the_map_is_compacted(self):
        self.create()
        insert(self.stub, "m", [scan(1, scan_of(1, 20000))])
        first = next(iter(self.stub.ReadArchive(pb.ReadArchiveRequest(map="m", length=1), timeout=60)))
        before = (self.data / "m.mapc").read_bytes()
        insert(self.stub, "m", [scan(1, scan_of(2, 20000))])
        self.stub.Compact(pb.CompactRequest(map="m", keep_last=1), timeout=60)
        self.assertNotEqual(zlib.crc32((self.data / "m.mapc").read_bytes()[:len(before)]), zlib.crc32(before))
        part = b"".join(r.data for r in self.stub.ReadArchive(
            pb.ReadArchiveRequest(map="m", file=first.file, length=len(before)), timeout=60))
        self.assertEqual(part, before)


class Standards(DaemonTest):
    def test_health(self):
        stub = health_rpc.HealthStub(self.daemon.channel())
        status = stub.Check(health.HealthCheckRequest(), timeout=10).status
        self.assertEqual(status, health.HealthCheckResponse.SERVING)
        watch = iter(stub.Watch(health.HealthCheckRequest(), timeout=60))
        self.assertEqual(next(watch).status, health.HealthCheckResponse.SERVING)

    def test_reflection(self):
        stub = reflection_rpc.ServerReflectionStub(self.daemon.channel())
        ask = reflection.ServerReflectionRequest(list_services="")
        reply = next(iter(stub.ServerReflectionInfo(iter([ask]), timeout=10)))
        names = [s.name for s in reply.list_services_response.service]
        self.assertIn("mapcodec.v1.MapService", names)
        self.assertIn("grpc.health.v1.Health", names)
        ask = reflection.ServerReflectionRequest(file_containing_symbol="mapcodec.v1.MapService")
        reply = next(iter(stub.ServerReflectionInfo(iter([ask]), timeout=10)))
        self.assertGreater(len(reply.file_descriptor_response.file_descriptor_proto), 0)

    def test_deadlines_and_cancellation(self):
        self.create()
        watch = self.stub.Watch(pb.WatchRequest(map="m"), timeout=0.3)
        self.refuses(grpc.StatusCode.DEADLINE_EXCEEDED, lambda: watch)
        idle = self.stub.Insert(iter([opening("m")]), timeout=60)
        list(idle)
        self.assertEqual(self.stub.Stats(pb.StatsRequest(), timeout=10).watchers, 0)

    def test_terminate_commits_what_was_sent(self):
        self.create()
        go = threading.Event()

        def scans():
            yield opening("m")
            yield scan(1, scan_of(1, 50000))
            go.wait(30)

        replies = iter(self.stub.Insert(scans(), timeout=60))
        self.assertTrue(next(replies).opened)
        watch = self.stub.Watch(pb.WatchRequest(map="m", since=1), timeout=60)
        while next(iter(watch)).revision < 2:
            pass
        code = self.daemon.stop()
        go.set()
        self.assertEqual(code, 0, self.daemon.said())
        self.start()
        self.assertEqual(self.stub.Stats(pb.StatsRequest(map="m"), timeout=10).map.points, 50000)


if __name__ == "__main__":
    unittest.main()

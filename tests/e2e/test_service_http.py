# SPDX-License-Identifier: GPL-3.0-or-later
"""The daemon's HTTP side through curl, Python's own client and Prometheus' own parser."""
import http.client
import json
import os
import struct
import subprocess
import time
import unittest

from prometheus_client.parser import text_string_to_metric_families

from daemon import DaemonTest, fetch, insert, scan, scan_of


class HttpTest(DaemonTest):
    arguments = ("--http", "127.0.0.1:0")

    def start(self, *arguments):
        super().start(*arguments)
        addresses = self.daemon.port_file.read_text().split()
        self.url = next(a for a in addresses if a.startswith("http"))

    def curl(self, path, *arguments):
        """@return status, headers (lower case), body"""
        body, head = self.folder / "body", self.folder / "head"
        for file in (body, head):
            file.write_bytes(b"")
        code = subprocess.run(["curl", "-s", "--path-as-is", "-o", body, "-D", head, "-w", "%{http_code}", *arguments, self.url + path],
                              check=True, capture_output=True, timeout=60).stdout
        lines = [line.split(": ", 1) for line in head.read_text().splitlines() if ": " in line]
        return int(code), {name.lower(): value for name, value in lines}, body.read_bytes()

    def index(self):
        code, headers, body = self.curl("/maps/m/index")
        self.assertEqual((code, headers["content-type"]), (200, "application/json"))
        return json.loads(body), headers

    def fill(self, scans=3):
        self.create(tile_size=5)
        for k in range(scans):
            insert(self.stub, "m", [scan(1, scan_of(k, 2000))])


class Tiles(HttpTest):
    def test_tiles_are_those_of_grpc(self):
        self.fill()
        index, _ = self.index()
        facts, tiles = fetch(self.stub, map="m")
        self.assertEqual(index["revision"], facts.revision)
        self.assertEqual(len(index["tiles"]), len(tiles))
        by_key = {f"{t.key.level}_{t.key.x}_{t.key.y}_{t.key.z}": data for t, data in tiles}
        connection = http.client.HTTPConnection(self.url.split("//")[1])
        for tile in index["tiles"][::7]:
            connection.request("GET", f"/maps/m/tiles/{tile['key']}")  # one connection for all
            answer = connection.getresponse()
            self.assertEqual(answer.status, 200)
            self.assertEqual(answer.read(), by_key[tile["key"]])
            self.assertEqual([int(n) for n in answer.headers["Mapcodec-Segments"].split(",")], tile["segments"])
            if "etag" in tile:
                self.assertEqual(answer.headers["ETag"], f'"{tile["etag"]}"')
        connection.close()

    def test_etag(self):
        self.fill()
        path = "/maps/m/tiles/" + self.index()[0]["tiles"][0]["key"]
        code, headers, body = self.curl(path)
        self.assertEqual((code, headers["content-type"], headers["accept-ranges"]), (200, "application/octet-stream", "bytes"))
        self.assertEqual(int(headers["content-length"]), len(body))
        etag = headers["etag"]
        self.assertRegex(etag, r'^"[0-9a-f]{32}"$')
        for value, wanted in ((etag, 304), (f'W/{etag}, "x"', 304), ("*", 304), ('"x"', 200)):
            code, headers, got = self.curl(path, "-H", f"If-None-Match: {value}")
            self.assertEqual((code, headers["etag"]), (wanted, etag))
            self.assertEqual(got, b"" if wanted == 304 else body)
        # curl's own way: it stores the tag, and fetches nothing the second time.
        tags = self.folder / "etags"
        self.assertEqual(self.curl(path, "--etag-save", tags)[0], 200)
        self.assertEqual(self.curl(path, "--etag-compare", tags)[0], 304)

    def test_a_changed_tile_has_another_etag_and_others_keep_theirs(self):
        self.fill()
        before = {t["key"]: self.curl(f"/maps/m/tiles/{t['key']}", "-I")[1]["etag"] for t in self.index()[0]["tiles"][:20]}
        insert(self.stub, "m", [scan(1, struct.pack("<3f", 1.234, 2.345, 3.456) * 1)])
        changed = [k for k, tag in before.items() if self.curl(f"/maps/m/tiles/{k}", "-I")[1]["etag"] != tag]
        self.assertLessEqual(len(changed), 1)

    def test_range(self):
        self.fill()
        path = "/maps/m/tiles/" + self.index()[0]["tiles"][0]["key"]
        whole = self.curl(path)[2]
        size = len(whole)
        for asked, part in (("0-9", slice(0, 10)), ("5-", slice(5, None)), ("-7", slice(size - 7, None)), (f"3-{10 * size}", slice(3, None))):
            code, headers, body = self.curl(path, "-r", asked)
            self.assertEqual((code, body), (206, whole[part]))
            begin = range(size)[part][0]
            self.assertEqual(headers["content-range"], f"bytes {begin}-{begin + len(body) - 1}/{size}")
        code, headers, body = self.curl(path, "-r", f"{size}-")
        self.assertEqual((code, headers["content-range"], body), (416, f"bytes */{size}", b""))
        self.assertEqual(self.curl(path, "-r", "0-1,3-4")[::2], (200, whole))  # the whole is allowed, and cheaper
        self.assertEqual(self.curl(path, "-r", "0-1", "-H", 'If-Range: "other"')[::2], (200, whole))
        # Resuming, as curl does it.
        partial = self.folder / "partial"
        partial.write_bytes(whole[:size // 2])
        subprocess.run(["curl", "-sf", "-C", "-", "-o", partial, self.url + path], check=True)
        self.assertEqual(partial.read_bytes(), whole)

    def test_head_and_identity(self):
        self.fill()
        path = "/maps/m/tiles/" + self.index()[0]["tiles"][0]["key"]
        whole = self.curl(path)
        head = self.curl(path, "-I")
        self.assertEqual((head[0], head[1]["content-length"], head[2][:4]), (200, whole[1]["content-length"], b"HTTP"))
        code, headers, body = self.curl(path, "-H", "Accept-Encoding: gzip, br")
        self.assertEqual((code, headers.get("content-encoding"), body), (200, None, whole[2]))
        self.assertNotIn("content-encoding", self.curl("/maps/m/index", "-H", "Accept-Encoding: br")[1])

    def test_older_revisions(self):
        self.fill()
        old = json.loads(self.curl("/maps/m/index?revision=2")[2])
        self.assertEqual(old["revision"], 2)
        self.assertEqual(self.index()[0]["revision"], 4)
        key = old["tiles"][0]["key"]
        self.assertEqual(self.curl(f"/maps/m/tiles/{key}?revision=2")[1]["mapcodec-revision"], "2")
        self.assertEqual(self.curl(f"/maps/m/tiles/{key}?revision=99")[0], 404)
        self.assertEqual(self.curl("/maps/m/index?revision=nothing")[0], 404)

    def test_index_has_an_etag(self):
        self.fill()
        etag = self.index()[1]["etag"]
        self.assertEqual(self.curl("/maps/m/index", "-H", f"If-None-Match: {etag}")[0], 304)
        insert(self.stub, "m", [scan(1, scan_of(77, 100))])
        self.assertEqual(self.curl("/maps/m/index", "-H", f"If-None-Match: {etag}")[0], 200)

    def test_what_is_not_there(self):
        self.fill(1)
        for path, code in (("/", 404), ("/maps", 404), ("/maps/", 404), ("/maps/m", 404), ("/maps/m/", 404), ("/maps/m/x", 404),
                           ("/maps/other/index", 404), ("/maps/m/tiles/", 400), ("/maps/m/tiles/0_0_0", 400),
                           ("/maps/m/tiles/0_9999_0_0", 404), ("/maps/m/tiles/7_0_0_0_0", 404), ("/maps/m/index/", 404)):
            self.assertEqual(self.curl(path)[0], code, path)

    def test_path_tricks(self):
        for path in ("/maps/../index", "/maps/%2e%2e/index", "/maps/..%2f..%2fetc%2fpasswd/index", "/maps/%00/index",
                     "/maps/m%00/index", "/maps/.m/index", "/maps/m%0d%0aX:%20y/index", "/maps/" + "a" * 5000 + "/index",
                     "/maps/m/tiles/..%2f..%2fetc%2fpasswd", "//maps/m/index", "/maps//index", "/../../etc/passwd"):
            code, _, body = self.curl(path)
            self.assertIn(code, (400, 404), path)
            self.assertNotIn(b"root:", body)

    def test_only_reading(self):
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
            code, headers, _ = self.curl("/healthz", "-X", method)
            self.assertEqual((code, headers["allow"]), (405, "GET, HEAD"), method)
        for method in ("TRACE", "CONNECT", "NONSENSE"):
            self.assertIn(self.curl("/healthz", "-X", method)[0], (400, 405), method)

    def test_request_ids(self):
        self.assertEqual(self.curl("/healthz", "-H", "X-Request-Id: walk-7")[1]["x-request-id"], "walk-7")
        self.assertRegex(self.curl("/healthz", "-H", "X-Request-Id: a b")[1]["x-request-id"], "^[0-9a-f]{16}$")
        self.assertIn("id=walk-7", self.daemon.said())


class Figures(HttpTest):
    def families(self):
        code, headers, body = self.curl("/metrics")
        self.assertEqual((code, headers["content-type"]), (200, "text/plain; version=0.0.4; charset=utf-8"))
        if os.path.exists("/usr/bin/promtool"):
            subprocess.run(["/usr/bin/promtool", "check", "metrics"], input=body, check=True)
        return {f.name: f for f in text_string_to_metric_families(body.decode())}

    def value(self, families, name, **labels):
        found = [s.value for s in families[name].samples
                 if labels.items() <= s.labels.items() and not s.name.endswith(("_bucket", "_sum", "_count"))]
        self.assertEqual(len(found), 1, (name, labels))
        return found[0]

    def test_prometheus_reads_them_and_they_are_right(self):
        self.fill()
        index, _ = self.index()
        self.curl("/maps/m/tiles/" + index["tiles"][0]["key"])
        self.curl("/maps/nothing/index")
        f = self.families()
        self.assertEqual(self.value(f, "mapcodec_maps"), 1)
        self.assertEqual(self.value(f, "mapcodec_map_revision", map="m"), 4)
        self.assertEqual(self.value(f, "mapcodec_map_tiles", map="m"), len(index["tiles"]))
        self.assertEqual(self.value(f, "mapcodec_map_points", map="m"), 6000)
        self.assertEqual(self.value(f, "mapcodec_points_in"), 6000)
        self.assertEqual(self.value(f, "mapcodec_scans_in"), 3)
        self.assertEqual(self.value(f, "mapcodec_commits", outcome="done"), 3)
        self.assertEqual(self.value(f, "mapcodec_tiles", outcome="sent"), 1)
        self.assertEqual(self.value(f, "mapcodec_requests", transport="http", method="tile", code="200"), 1)
        self.assertEqual(self.value(f, "mapcodec_requests", transport="grpc", method="Insert", code="OK"), 3)
        self.assertEqual(self.value(f, "mapcodec_errors", transport="http", code="404"), 1)
        self.assertEqual(self.value(f, "mapcodec_queue_points"), 0)
        self.assertGreater(self.value(f, "mapcodec_bytes", direction="in"), 3 * 24000)
        self.assertGreater(self.value(f, "mapcodec_cache_limit_bytes"), 0)
        for name in ("mapcodec_request_seconds", "mapcodec_commit_seconds", "mapcodec_commit_scans"):
            self.assertEqual(f[name].type, "histogram")
        for name in ("mapcodec_cache_hits", "mapcodec_cache_bytes", "mapcodec_compactions", "mapcodec_compacting",
                     "mapcodec_watchers", "mapcodec_busy", "mapcodec_allocated_bytes",
                     "process_resident_memory_bytes", "mapcodec_http_connections"):
            self.assertIn(name, f)

    def test_hostile_paths_make_no_series(self):
        for k in range(50):
            self.curl(f"/maps/x{k}/index")
            self.curl(f"/{k}")
        self.assertLess(len(self.families()["mapcodec_requests"].samples), 10)

    def test_health(self):
        self.assertEqual(self.curl("/healthz")[::2], (200, b"ok\n"))


class Many(HttpTest):
    def test_many_requests_on_few_connections(self):
        self.fill(1)
        connections = [http.client.HTTPConnection(self.url.split("//")[1]) for _ in range(8)]
        keys = [t["key"] for t in self.index()[0]["tiles"][:8]]
        begin = time.monotonic()
        for _ in range(50):
            for connection, key in zip(connections, keys):
                connection.request("GET", f"/maps/m/tiles/{key}")
            for connection in connections:
                answer = connection.getresponse()
                answer.read()
                self.assertEqual(answer.status, 200)
        self.assertLess(time.monotonic() - begin, 60)
        for connection in connections:
            connection.close()


if __name__ == "__main__":
    unittest.main()

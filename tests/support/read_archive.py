#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A second reader of map archives, slow and readable, laid out like maps/FORMAT.md.

Usage: read_archive.py MAP.mapc [--revision N] [--tiles] [--expect LISTING]
Lists the revisions and, with --tiles, every tile; checks every checksum; exit code 1 if anything does not fit, or if the
listing is not that of the file given with --expect.
Needs the standard library and, for columns that are zstd frames, the zstd program.
"""
import argparse
import math
import struct
import subprocess
import sys


class Damaged(Exception):
    pass


# --- 1. Conventions -----------------------------------------------------------------------------------------------

def make_crc_table():
    table = []
    for i in range(256):
        for _ in range(8):
            i = (i >> 1) ^ (0x82F63B78 if i & 1 else 0)
        table.append(i)
    return table


CRC_TABLE = make_crc_table()


def crc32c(data, crc=0):
    crc ^= 0xFFFFFFFF
    for byte in data:
        crc = (crc >> 8) ^ CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0

    def raw(self, count):
        if count > len(self.data) - self.at:
            raise Damaged("a block ends too early")
        self.at += count
        return self.data[self.at - count : self.at]

    def uint(self, size):
        return int.from_bytes(self.raw(size), "little")

    def f32(self):
        return struct.unpack("<f", self.raw(4))[0]

    def f64(self):
        return struct.unpack("<d", self.raw(8))[0]

    def short_f64(self):
        count = self.uint(1)
        return struct.unpack("<d", bytes(8 - count) + self.raw(count))[0]

    def varint(self):
        value = shift = 0
        while True:
            byte = self.uint(1)
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def signed(self):
        return unzigzag(self.varint())

    def sized(self):
        return self.raw(self.varint())

    def left(self):
        return len(self.data) - self.at


def unzigzag(v):
    return (v >> 1) ^ -(v & 1)


# --- 2. Header ----------------------------------------------------------------------------------------------------

MAGIC = b"\x89MPC\r\n"
HEADER_BYTES = 8


def check_header(file):
    if file[:6] != MAGIC:
        raise Damaged("not a mapcodec archive")
    major, minor = file[6], file[7]
    if major > 0:
        raise Damaged(f"format version {major}.{minor} is too new")
    return f"{major}.{minor}"


# --- 3. Commit record ---------------------------------------------------------------------------------------------

RECORD_MAGIC = b"\xc3mp\x1e"
RECORD_BYTES = 32


class Commit:
    """The record at `offset` and its blocks, or Damaged."""

    def __init__(self, file, offset):
        r = Reader(file[offset : offset + RECORD_BYTES])
        if r.raw(4) != RECORD_MAGIC:
            raise Damaged(f"no commit record at {offset}")
        self.offset = offset
        self.waypoint = r.uint(1) & 1
        self.timestamp = r.uint(5)
        self.previous = r.uint(6)
        self.revision = r.uint(4)
        index_bytes, metadata_bytes = r.uint(4), r.uint(4)
        self.begin = self.previous + RECORD_BYTES if self.previous else HEADER_BYTES
        self.end = offset - index_bytes - metadata_bytes  # of the segments
        if self.end < self.begin:
            raise Damaged(f"the commit at {offset} is longer than its room")
        blocks = file[self.end : offset]
        self.index, self.metadata = blocks[:index_bytes], blocks[index_bytes:]
        fields = file[offset : offset + RECORD_BYTES - 4]
        if r.uint(4) != crc32c(file[:HEADER_BYTES] + struct.pack("<Q", offset) + blocks + fields):
            raise Damaged(f"the commit at {offset} does not match its checksum")


def last_commit(file):
    """Backwards from the end; a plain search, without the bound and the waypoints of section 3.2."""
    at = len(file) - RECORD_BYTES
    while at >= HEADER_BYTES:
        at = file.rfind(RECORD_MAGIC, 0, at + 4)
        if at < 0:
            break
        try:
            commit = Commit(file, at)
            if not commit.waypoint:
                return commit
        except Damaged:
            pass
        at -= 1
    raise Damaged("no whole commit")


def all_commits(file):
    """The oldest first."""
    commits = [last_commit(file)]
    while commits[-1].previous:
        commits.append(Commit(file, commits[-1].previous))
        if commits[-1].waypoint or commits[-1].revision >= commits[-2].revision:
            raise Damaged("the chain of commits is broken")
    return commits[::-1]


# --- 4. Metadata --------------------------------------------------------------------------------------------------

BOUNDS_BITS = 20


def read_metadata(block):
    r = Reader(block)
    parts = r.uint(2)
    m = {"schema": r.sized()}
    if parts & 32:
        at = r.varint()
        *m["origin"], m["tile_size"] = struct.unpack("<4d", m["schema"][at : at + 32])
    else:
        m["origin"] = [r.short_f64() for _ in range(3)]
        m["tile_size"] = r.short_f64()
    m["more_input_points"] = r.signed()
    m["input_bytes"] = r.varint()
    m["dropped_points"] = r.varint()
    m["achieved"] = [(r.f64() if i == 1 else r.f32()) if parts & (1 << i) else 0.0 for i in range(4)]
    if parts & 16:
        unit = math.ldexp(m["tile_size"], -BOUNDS_BITS)
        m["bounds"] = []
        for d in range(3):
            low, extent = r.signed(), r.varint()
            m["bounds"].append([m["origin"][d] + k * unit for k in (low, low + extent)])
    m["flags"] = r.varint() if parts & 64 else 0
    m["submaps"], m["snapshots"], m["extras"] = [], [], {}
    if parts & 128:
        for _ in range(r.varint()):
            m["submaps"].append((r.sized().decode(), [r.f64() for _ in range(9)]))
    if parts & 256:
        for _ in range(r.varint()):
            m["snapshots"].append((r.sized().decode(), r.varint()))
    if parts & 512:
        for _ in range(r.varint()):
            name = r.sized().decode()
            m["extras"][name] = r.sized()
    if r.left():
        raise Damaged("bytes are left over after the metadata")
    return m


# --- 5. Columns ---------------------------------------------------------------------------------------------------

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def inflate(stored, size):
    out = subprocess.run(["zstd", "-dc"], input=ZSTD_MAGIC + stored, stdout=subprocess.PIPE, check=True).stdout
    if len(out) != size:
        raise Damaged("a zstd frame has the wrong size")
    return out


def read_column(r, count):
    if count == 0:
        return []
    if count == 1:
        return [r.varint()]
    form = r.uint(1)
    least = 0 if 0x40 < form < 0x80 else r.varint()
    if form < 0x80:
        form = form - 0x40 if form > 0x40 else form
        bits = int.from_bytes(r.raw((count * form + 7) // 8), "little")
        return [least + (bits >> (i * form) & ((1 << form) - 1)) for i in range(count)]
    planes = form - 0x80
    if not 1 <= planes <= 8:
        raise Damaged("a column has an unknown form")
    data = inflate(r.sized(), count * planes)
    return [least + sum(data[p * count + i] << (8 * p) for p in range(planes)) for i in range(count)]


# --- 6. Index -----------------------------------------------------------------------------------------------------

FULL_CUBE = 0x1E
UNPLACED_LEVEL = 255


def tile_error(scale, number):
    if scale == 0:
        return 0.0
    unit = math.ldexp(1, math.frexp(scale)[1] - 6)
    return min(scale, (math.ceil(scale / unit) - number) * unit)


def sums(differences):
    total, out = 0, []
    for d in differences:
        total += unzigzag(d)
        out.append(total)
    return out


def tile_bounds(tile, metadata):
    """Section 6.3, without the outward slack of a few units in the last place."""
    if tile["level"] == UNPLACED_LEVEL:
        return None
    side = math.ldexp(metadata["tile_size"], tile["level"])
    cell = math.ldexp(side / 14, tile["reach"])
    box = []
    for d in range(3):
        low = metadata["origin"][d] + tile["xyz"[d]] * side + side / 2 - 8 * cell
        first, last = tile["axis"][d] >> 4, tile["axis"][d] & 15
        box.append([low + first * cell, low + (last + 1) * cell])
    return box


def read_index(commit, metadata):
    """Returns (is delta, number of tiles after, tiles set, keys removed, dead ranges)."""
    r = Reader(commit.index)
    kind = r.uint(1)
    total = count = r.varint()
    removed = []
    if kind & 1:
        count, removed_count = r.varint(), r.varint()
        key = [0, 0, 0, 0]
        for _ in range(removed_count):
            key[0] += r.varint()
            level = r.varint()
            for d in range(1, 4):
                key[d] += r.signed()
            removed.append((key[0], level, *key[1:]))
    present = r.uint(2)

    def column(bit, n=count):
        return read_column(r, n) if present & (1 << bit) else [0] * n

    submap, level = sums(column(0)), column(1)
    xyz = [sums(column(bit)) for bit in (2, 3, 4)]
    codec, points = read_column(r, count), read_column(r, count)
    extra, reach = column(5), column(6)
    axes = [column(bit) for bit in (7, 8, 9)]
    scale = [metadata["achieved"][i] if kind >> (4 + i) & 1 else r.f64() if i == 1 else r.f32() for i in range(4)]
    codes = [column(bit) for bit in (10, 11, 12, 13)]
    segment_count = count + sum(extra)
    crcs = [r.uint(4) for _ in range(segment_count)]
    lengths, gaps = read_column(r, segment_count), column(14, segment_count)
    segments, expected = [], commit.begin
    for crc, length, gap in zip(crcs, lengths, gaps):
        offset = expected + unzigzag(gap)
        segments.append((offset, length, crc))
        expected = offset + length
    dead, expected = [], commit.begin
    if present & (1 << 15):
        for _ in range(r.varint()):
            offset = expected + r.varint()
            length = r.varint()
            dead.append((offset, length, r.uint(4)))
            expected = offset + length
    hashes = [r.raw(16).hex() for _ in range(segment_count)] if kind & 2 else None
    if r.left():
        raise Damaged("bytes are left over after the index")

    tiles, used = {}, 0
    for i in range(count):
        tile = {"submap": submap[i], "level": level[i], "x": xyz[0][i], "y": xyz[1][i], "z": xyz[2][i],
                "codec": codec[i], "points": points[i], "reach": reach[i],
                "axis": [axes[d][i] ^ FULL_CUBE for d in range(3)],
                "errors": [tile_error(scale[e], codes[e][i]) for e in range(4)],
                "segments": segments[used : used + extra[i] + 1],
                "hashes": hashes[used : used + extra[i] + 1] if hashes else None}
        used += extra[i] + 1
        tile["bounds"] = tile_bounds(tile, metadata)
        tiles[(submap[i], level[i], *(xyz[d][i] for d in range(3)))] = tile
    return kind & 1, total, tiles, removed, dead


# --- 7. A revision: the chain put together -------------------------------------------------------------------------

def check_area(file, commit, tiles, dead):
    """The commit's own ranges must cover its area without gap or overlap, and match their checksums."""
    own = [s for t in tiles.values() for s in t["segments"] if s[0] >= commit.begin]
    at = commit.begin
    for offset, length, crc in sorted(own + dead):
        if offset != at:
            raise Damaged(f"gap or overlap at {at}")
        if crc32c(file[offset : offset + length]) != crc:
            raise Damaged(f"the segment at {offset} does not match its checksum")
        at = offset + length
    if at != commit.end:
        raise Damaged(f"bytes at {at} belong to nothing")


def read_revisions(file):
    """Yields (commit, metadata, tiles) of every revision, the oldest first, checking all bytes."""
    metadata, tiles = None, {}
    for commit in all_commits(file):
        if commit.metadata:
            metadata = read_metadata(commit.metadata)
        delta, total, changed, removed, dead = read_index(commit, metadata)
        check_area(file, commit, changed, dead)
        tiles = dict(tiles) if delta else {}
        for key in removed:
            del tiles[key]
        tiles.update(changed)
        if len(tiles) != total:
            raise Damaged(f"revision {commit.revision} has {len(tiles)} tiles, not {total}")
        yield commit, metadata, tiles


def tile_line(tile):
    errors = " ".join(f"{e:.9g}" for e in tile["errors"])
    segments = " ".join(f"{offset}+{length}:{crc:08x}" for offset, length, crc in tile["segments"])
    return (f"tile {tile['submap']} {tile['level']} {tile['x']} {tile['y']} {tile['z']} codec {tile['codec']} "
            f"points {tile['points']} errors {errors} segments {segments}")


def hash_line(tile):
    return f"hashes {tile['submap']} {tile['level']} {tile['x']} {tile['y']} {tile['z']} {' '.join(tile['hashes'])}"


def listing(file, options):
    version = check_header(file)
    shown, lines = None, []
    for commit, metadata, tiles in read_revisions(file):
        points = sum(t["points"] for t in tiles.values())
        lines.append(f"revision {commit.revision} time {commit.timestamp} tiles {len(tiles)} points {points}")
        if options.revision in (None, commit.revision):
            shown = metadata, tiles, points
    if shown is None:
        raise Damaged(f"no revision {options.revision}")
    metadata, tiles, points = shown
    origin = " ".join(f"{v:.9g}" for v in metadata["origin"])
    lines.append(f"format {version} origin {origin} tile_size {metadata['tile_size']:.9g} "
                 f"input_points {metadata['more_input_points'] + points}")
    if options.tiles:
        lines += [tile_line(t) for t in tiles.values()]
        lines += [hash_line(t) for t in tiles.values() if t["hashes"]]
    trailing = len(file) - last_commit(file).offset - RECORD_BYTES
    if trailing:
        raise Damaged(f"{trailing} bytes after the last whole commit")
    return lines


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("map")
    arguments.add_argument("--revision", type=int)
    arguments.add_argument("--tiles", action="store_true")
    arguments.add_argument("--expect")
    options = arguments.parse_args()
    with open(options.map, "rb") as f:
        file = f.read()
    try:
        lines = listing(file, options)
    except (Damaged, KeyError, IndexError, struct.error, subprocess.CalledProcessError) as error:
        print(f"read_archive.py: {options.map}: {error}", file=sys.stderr)
        return 1
    print("\n".join(lines))
    if options.expect is None:
        return 0
    with open(options.expect) as f:
        expected = f.read().splitlines()
    if sorted(lines) == sorted(expected):
        return 0
    for line in sorted(set(lines) ^ set(expected))[:10]:
        print(f"read_archive.py: differs: {line}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A second reader of tiles, slow and readable, laid out like mapcodec/FORMAT.md.

Usage: read_tile.py MAP.mapc... [--expect HASHES.json]
Prints, for each tile of the last revision, its codec, number of points and the SHA-256 of its coordinates (float64,
little-endian, x y z, in decoded order), then the hash of all points with all channels in any order (as
mapcodec/quality/multiset_hash.hpp). With --expect: exit code 1 unless the file says the same, under each map's name.
Reads `lossless`, `points`, `surface` and `occupancy` tiles with all their channels. It does not read `paper` tiles (section 7).
read_archive.py reads the archive around the tiles; sections 4, 5, 6, 8, 10, 11 and 12 are in tile_entropy.py, tile_geometry.py,
tile_channels.py, tile_surface.py, tile_segments.py and tile_occupancy.py. Standard library only, but for what read_archive.py needs.
"""
import argparse
import hashlib
import json
import pathlib
import struct
import sys

from read_archive import Damaged, Reader, check_header, read_revisions
from tile_channels import SCALAR_SIZE, read_channel
from tile_entropy import M64
from tile_geometry import read_lossless, read_points
from tile_occupancy import read_occupancy
from tile_segments import read_segments
from tile_surface import read_surface

CODEC = {1: "lossless", 2: "points", 3: "paper", 4: "surface", 5: "occupancy", 7: "updated"}
EXACT, BOUNDED, CONSTANT, DROPPED = 1, 2, 3, 4
FLOAT32, FLOAT64, FIXED = 1, 2, 3


# --- 2. The map schema --------------------------------------------------------------------------------------------

def read_schema(block):
    r = Reader(block)
    s = {"promise": r.uint(1), "coordinates": r.uint(1), "promise_value": r.f64(),
         "origin": [r.f64() for _ in range(3)], "tile_size": r.f64(), "step": r.f64(), "channels": []}
    if s["coordinates"] == FIXED:
        s["scale"] = [r.f64() for _ in range(3)]
        s["offset"] = [r.f64() for _ in range(3)]
    for _ in range(r.varint()):
        c = {"name": r.sized().decode(), "scalar": r.uint(1), "components": r.uint(1), "kept": r.uint(1)}
        if c["kept"] == BOUNDED:
            c["bound"] = r.f64()
        if c["kept"] == CONSTANT:
            c["constant"] = r.raw(SCALAR_SIZE[c["scalar"]] * c["components"])
        s["channels"].append(c)
    return s


# --- 3. A tile ----------------------------------------------------------------------------------------------------

def read_tile(payload, schema):
    """Codec, coordinates (one triple per point) and the values (bytes) of each channel that is not dropped, by name."""
    r = Reader(payload)
    codec, flags, count = r.uint(1), r.uint(1), r.varint()
    step = r.f64() if flags & 1 else schema["step"]
    if codec == 5 and flags == 0:
        return codec, *read_occupancy(r.raw(r.left()), count, schema)
    if codec not in (1, 2, 4) or flags > 3:
        raise Damaged(f"no reader for codec {codec}, flags {flags}")
    coded = [c for c in schema["channels"] if c["kept"] in (EXACT, BOUNDED)]
    sections = [r.sized() for _ in coded] + [r.raw(r.left())]
    if codec == 1:
        xyz, voxels = read_lossless(sections[0], count, schema)
    elif codec == 4:
        xyz, voxels = read_surface(sections[0], count, schema, step)
    else:
        xyz, voxels = read_points(sections[0], count, schema, step)
    channels = {c["name"]: read_channel(s, c, voxels) for c, s in zip(coded, sections[1:])}
    for c in schema["channels"]:
        if c["kept"] == CONSTANT:
            channels[c["name"]] = [c["constant"]] * count
    return codec, xyz, channels


# --- What is printed ----------------------------------------------------------------------------------------------

def rotated(v, by):
    return (v << by | v >> (64 - by)) & M64


def scrambled(h):
    h = (h ^ h >> 31) * 0xBF58476D1CE4E5B9 & M64
    h = (h ^ h >> 29) * 0x94D049BB133111EB & M64
    return h ^ h >> 32


class Lanes:
    def __init__(self, a=0x243F6A8885A308D3, b=0x13198A2E03707344):
        self.a, self.b = a, b

    def word(self, w):
        self.a = (rotated((self.a ^ w) * 0x9FB21C651E98DF25 & M64, 29) + self.b) & M64
        self.b = ((rotated(self.b, 23) + w) * 0xC4CEB9FE1A85EC53 & M64) ^ self.a >> 35

    def bytes(self, data):
        for at in range(0, len(data), 8):
            part = data[at : at + 8]
            self.word(int.from_bytes(part, "little") | (len(part) << 56 if len(part) < 8 else 0))

    def sum(self):
        high = scrambled(((self.b ^ rotated(self.a, 41)) + 0xD1B54A32D192ED03) & M64)
        return high << 64 | scrambled((self.a + rotated(self.b, 17)) & M64)


def coordinate_bits(schema, v, axis):
    if schema["coordinates"] == FLOAT32:
        return int.from_bytes(struct.pack("<f", v), "little")
    if schema["coordinates"] == FIXED:
        k = (v - schema["offset"][axis]) / schema["scale"][axis]
        if abs(k) <= 2**31:
            return int(k + (0.5 if k >= 0 else -0.5)) & M64
        return ~int.from_bytes(struct.pack("<d", v), "little") & M64
    return int.from_bytes(struct.pack("<d", v), "little")


def multiset_sum(schema, xyz, channels):
    start = Lanes()
    start.word(schema["coordinates"])
    kept = sorted((c for c in schema["channels"] if c["kept"] != DROPPED), key=lambda c: c["name"].encode())
    for c in kept:
        start.word(c["scalar"] << 8 | c["components"])
        for letter in c["name"].encode():
            start.word(letter)
    total = 0
    for i, p in enumerate(xyz):
        lanes = Lanes(start.a, start.b)
        for axis, v in enumerate(p):
            lanes.word(coordinate_bits(schema, v, axis))
        for c in kept:
            lanes.bytes(channels[c["name"]][i])
        total += lanes.sum()
    return total


def digest(file):
    """What hashes.json says of a map."""
    check_header(file)
    *_, (_, metadata, tiles) = read_revisions(file)
    schema, lines, points, total = read_schema(metadata["schema"]), [], 0, 0
    for tile in tiles.values():
        segments = [file[offset : offset + length] for offset, length, *_ in tile["segments"]]
        codec, xyz, channels = read_segments(segments, schema, read_tile)
        coordinates = hashlib.sha256(b"".join(struct.pack("<3d", *p) for p in xyz)).hexdigest()
        lines.append({"codec": CODEC[codec], "points": len(xyz), "coordinates_sha256": coordinates})
        points += len(xyz)
        total += multiset_sum(schema, xyz, channels)
    return {"points": points, "multiset_hash": f"{total % (1 << 128):032x}", "tiles": lines}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("maps", nargs="+", type=pathlib.Path)
    arguments.add_argument("--expect", type=pathlib.Path)
    options = arguments.parse_args()
    expected = json.loads(options.expect.read_text()) if options.expect else None
    failed = False
    for path in options.maps:
        try:
            found = digest(path.read_bytes())
        except (Damaged, KeyError, IndexError, struct.error) as error:
            print(f"read_tile.py: {path}: {error!r}", file=sys.stderr)
            failed = True
            continue
        print(f"{path} points {found['points']} multiset_hash {found['multiset_hash']}")
        for t in found["tiles"]:
            print(f"  tile codec {t['codec']} points {t['points']} coordinates {t['coordinates_sha256']}")
        if expected is not None and expected.get(path.stem) != found:
            print(f"read_tile.py: {path}: decodes to something else than {options.expect} says", file=sys.stderr)
            failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

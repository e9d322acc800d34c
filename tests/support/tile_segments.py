# SPDX-License-Identifier: GPL-3.0-or-later
"""Section 11 of mapcodec/FORMAT.md: segments of a tile that was updated."""
import struct

from read_archive import Damaged, Reader

ERASURE, JOINED = 6, 7
BOX, SPHERE, VALUES, INVERSE, MOTION = 1, 2, 4, 8, 16
LETTER = {1: "B", 2: "b", 3: "H", 4: "h", 5: "I", 6: "i", 7: "Q", 8: "q", 9: "f", 10: "d"}


def split(payload):
    """The payloads and erasures that a payload was joined from."""
    if payload[0] != JOINED:
        return [payload]
    r = Reader(payload[1:])
    parts = [r.sized() for _ in range(r.varint())]
    if not parts or r.left() or any(p[0] == JOINED for p in parts):
        raise Damaged("segments do not fill their payload")
    return parts


def read_erasure(payload):
    r = Reader(payload[1:])
    bits = r.uint(1)
    if not bits & (BOX | SPHERE | VALUES) or bits > 31:
        raise Damaged(f"erasure with conditions {bits}")
    e = {"bits": bits}
    if bits & MOTION:
        e["motion"] = [r.f64() for _ in range(12)]
    if bits & BOX:
        e["box"] = [r.f64() for _ in range(6)]
    if bits & SPHERE:
        e["sphere"] = [r.f64() for _ in range(4)]
    if bits & VALUES:
        e["values"] = (r.sized().decode(), r.f64(), r.f64())
    if r.left():
        raise Damaged("bytes behind an erasure")
    return e


def holds(e, p, values, scalar):
    if e["bits"] & MOTION:
        m = e["motion"]
        p = [m[3 * d] * p[0] + m[3 * d + 1] * p[1] + m[3 * d + 2] * p[2] + m[9 + d] for d in range(3)]
    if e["bits"] & BOX and not all(e["box"][d] <= p[d] <= e["box"][3 + d] for d in range(3)):
        return False
    if e["bits"] & SPHERE:
        x, y, z = (p[d] - e["sphere"][d] for d in range(3))
        if not x * x + y * y + z * z <= e["sphere"][3] * e["sphere"][3]:
            return False
    if e["bits"] & VALUES:
        return e["values"][1] <= struct.unpack("<" + LETTER[scalar], values)[0] <= e["values"][2]
    return True


def read_segments(segments, schema, read_tile):
    """What read_tile gives, of all segments together; the codec is the first byte of the first one."""
    codec, xyz, channels = segments[0][0], [], {}
    for segment in (part for s in segments for part in split(s)):
        if segment[0] != ERASURE:
            _, more_xyz, more_channels = read_tile(segment, schema)
            xyz = xyz + list(more_xyz)
            channels = {name: list(channels.get(name, [])) + list(v) for name, v in more_channels.items()}
            continue
        e = read_erasure(segment)
        name = e["values"][0] if "values" in e else None
        scalar = next((c["scalar"] for c in schema["channels"] if c["name"] == name), None)
        inverse = bool(e["bits"] & INVERSE)
        keep = [i for i, p in enumerate(xyz)
                if holds(e, p, channels[name][i] if name else None, scalar) == inverse]
        xyz = [xyz[i] for i in keep]
        channels = {n: [v[i] for i in keep] for n, v in channels.items()}
    return codec, xyz, channels

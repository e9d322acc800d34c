#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the include lines and fails on an arrow that the design forbids.

Usage: check_arrows.py ROOT | check_arrows.py --self-test ROOT
"""
import re
import shutil
import sys
import tempfile
from pathlib import Path

ROOMS = ["mapcodec", "parallel", "maps", "slam_adapter", "tools", "tests"]  # each may include itself and what stands before it
UMBRELLA = "mapcodec/mapcodec.hpp"  # for users: stands above the rooms, and no room includes it
HEAVY = re.compile(r"^(tbb|oneapi|CGAL|pcl|Eigen|zstd|nanoflann|boost|thread$|mutex$|future$|filesystem$|fstream$)")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]', re.M)
FOLDERS = {"common", "core", "utils", "util"}
MACHINE_PATH = re.compile(r'["\'\s=](/(work|home|root|Users)/)')


def decode_side(root):
    """Sources of the target mapcodec_decode, and its headers that lie beside them."""
    found = set()
    for lists in (root / "mapcodec").rglob("CMakeLists.txt"):
        text = re.sub(r"#.*", "", lists.read_text())
        for block in re.findall(r"(?:target_sources\(\s*mapcodec_decode|mapcodec_library\(\s*decode)\b([^)]*)\)", text):
            for name in re.findall(r"\S+\.cpp", block):
                found.update(p for p in (lists.parent / name, (lists.parent / name).with_suffix(".hpp")) if p.exists())
    return found


def closure(root, files):
    """The files and every header of ours that they reach."""
    todo, seen = list(files), set()
    while todo:
        file = todo.pop()
        if file in seen:
            continue
        seen.add(file)
        todo += [root / i for i in INCLUDE.findall(file.read_text()) if (root / i).is_file()]
    return seen


def sources(root):
    for room in ROOMS:
        for path in sorted((root / room).rglob("*")):
            if path.suffix in (".hpp", ".cpp", ".h") and "golden" not in path.parts:
                yield room, path


def check(root):
    faults = []
    for room, path in sources(root):
        name = path.relative_to(root).as_posix()
        text = path.read_text()
        allowed = ROOMS[: ROOMS.index(room) + 1]
        for include in INCLUDE.findall(text):
            target = include.split("/")[0]
            if room not in ("tools", "tests") and include == UMBRELLA:
                faults.append(f"{name}: includes {include}, which is for users only")
            elif target in ROOMS and target not in allowed and name != UMBRELLA:
                faults.append(f"{name}: {room}/ must not include {include}")
            elif include.startswith("..") or (root / room / include).is_file() and "/" in include and target not in ROOMS:
                faults.append(f"{name}: include {include} from the repository root")
        if MACHINE_PATH.search(text):
            faults.append(f"{name}: names a path of one machine")
        if FOLDERS & set(path.relative_to(root).parts[:-1]):
            faults.append(f"{name}: no folder is named common, core or utils")
    for path in sorted(closure(root, decode_side(root))):
        for include in INCLUDE.findall(path.read_text()):
            if HEAVY.match(include):
                faults.append(f"{path.relative_to(root)}: the decode side must not include <{include}>")
    return faults


def self_test(root):
    """Each planted fault must be found, and nothing else."""
    line = '#include "{}"\n'
    plants = [("mapcodec/geometry/planted.hpp", line.format("parallel/runner.hpp")),
              ("parallel/planted.hpp", line.format("maps/map_archive.hpp")),
              ("maps/planted.cpp", line.format("slam_adapter/compress.hpp")),
              ("slam_adapter/planted.cpp", line.format("tools/main.hpp")),
              ("maps/planted.hpp", line.format(UMBRELLA)),
              ("mapcodec/base/crc32c.hpp", "#include <tbb/parallel_for.h>\n"),
              ("mapcodec/utils/planted.hpp", "#pragma once\n"),
              ("tools/planted.cpp", 'const char* p = "/' + 'home/me/map.pcd";\n')]
    for name, text in plants:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "copy"
            for room in ROOMS:
                shutil.copytree(root / room, copy / room, ignore=shutil.ignore_patterns("golden", "seeds"))
            path = copy / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a") as file:
                file.write(text)
            faults = check(copy)
            if not any(f.startswith(name) for f in faults):
                return [f"self-test: the fault planted in {name} was not found"]
    return []


def main():
    root = Path(sys.argv[-1]).resolve()
    faults = self_test(root) if "--self-test" in sys.argv else check(root)
    print("\n".join(faults) or "all arrows point the right way")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

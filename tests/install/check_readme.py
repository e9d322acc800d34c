#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""README.md must not drift: its C++ is the compiled consumer's, its commands and flags exist, its paths exist.

Usage: check_readme.py ROOT PROGRAM
"""
import re
import shlex
import subprocess
import sys
from pathlib import Path


def main():
    root, program = Path(sys.argv[1]), sys.argv[2]
    readme = (root / "README.md").read_text()
    faults = []

    compiled = (root / "tests/install/consumer/main.cpp").read_text()
    snippets = re.findall(r"```cpp\n(.*?)```", readme, re.S)
    faults += [f"not in consumer/main.cpp:\n{s}" for s in snippets if s not in compiled]
    if not snippets:
        faults.append("README.md quotes no C++")
    cmake = (root / "tests/install/consumer/CMakeLists.txt").read_text()
    faults += [f"not in consumer/CMakeLists.txt:\n{s}" for s in re.findall(r"```cmake\n(.*?)```", readme, re.S) if s not in cmake]

    for block in re.findall(r"```sh\n(.*?)```", readme, re.S):
        for line in re.findall(r"^(?:build/release/bin/)?(mapcodec .*)$", block, re.M):
            words = shlex.split(line, comments=True)
            help_text = subprocess.run([program, words[1], "--help"], capture_output=True, text=True)
            flags = [w.split("=")[0] for w in words if re.match(r"--?[a-z]", w)]
            if help_text.returncode != 0:
                faults.append(f"no such verb: {line}")
            faults += [f"no flag {f}: {line}" for f in flags if not re.search(re.escape(f) + r"\b", help_text.stdout)]

    for path in re.findall(r"`((?:mapcodec|maps|parallel|slam_adapter|tools|tests|cmake)/[\w./-]*|[A-Z]+\.md)`", readme):
        if not (root / path).exists():
            faults.append(f"no such path: {path}")
    print("\n".join(faults) or "README.md agrees with the code")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

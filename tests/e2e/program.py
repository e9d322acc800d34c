# SPDX-License-Identifier: GPL-3.0-or-later
"""The program under test, and what every test may ask of it."""
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

PROGRAM = os.environ.get("MAPCODEC", "build/release/bin/mapcodec")
ERROR_LINE = re.compile(r"mapcodec: [^\n]+: [^\n]+\n")

DONE, DIFFERENCE, USAGE, BAD_INPUT, CANNOT_WRITE, DAMAGED = range(6)


class Outcome:
    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    @property
    def json(self):
        return json.loads(self.out)

    def __repr__(self):
        return f"exit {self.code}\nstdout: {self.out[-2000:]}\nstderr: {self.err[-2000:]}"


def command(*arguments):
    return [PROGRAM, *map(str, arguments)]


def run(*arguments, timeout=600, **options):
    done = subprocess.run(command(*arguments), stdin=subprocess.DEVNULL, capture_output=True, timeout=timeout, **options)
    return Outcome(done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace"))


class ProgramTest(unittest.TestCase):
    """A folder of its own for every test, and the checks that all share."""

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="mapcodec-e2e-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def path(self, name):
        return self.folder / name

    def listing(self):
        return sorted(p.relative_to(self.folder).as_posix() for p in self.folder.rglob("*"))

    def succeeds(self, *arguments, **options):
        outcome = run(*arguments, **options)
        self.assertEqual(outcome.code, DONE, f"{arguments}: {outcome}")
        return outcome

    def fails(self, code, *arguments, names=None, says=None, **options):
        """Exit `code` and exactly one line on stderr, which names the file and says `says` (a pattern)."""
        outcome = run(*arguments, **options)
        codes = code if isinstance(code, tuple) else (code,)
        self.assertIn(outcome.code, codes, f"{arguments}: {outcome}")
        self.one_error_line(outcome, names, says)
        return outcome

    def one_error_line(self, outcome, names=None, says=None):
        if USAGE == outcome.code:
            self.assertRegex(outcome.err, r"\Amapcodec: [^\n]+\n\Z")
        else:
            self.assertRegex(outcome.err, r"\A" + ERROR_LINE.pattern + r"\Z")
        if names is not None:
            self.assertIn(str(names), outcome.err)
        if says is not None:
            self.assertRegex(outcome.err.lower(), says)

    def compress(self, source, *flags, name="map.mapc"):
        archive = self.path(name)
        self.succeeds("compress", source, "-o", archive, *flags)
        return archive

    def decompress(self, archive, *flags, name="out.pcd"):
        out = self.path(name)
        self.succeeds("decompress", archive, "-o", out, "--force", *flags)
        return out


def start(*arguments, **options):
    return subprocess.Popen(command(*arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            **options)


def killed_by_signal(code):
    """True for a crash (SIGSEGV, SIGABRT, a sanitizer's abort, ...), not for the signals that a test sends."""
    return code < 0 and -code not in (signal.SIGINT, signal.SIGKILL, signal.SIGTERM)

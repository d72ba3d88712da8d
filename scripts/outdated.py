# SPDX-License-Identifier: GPL-3.0-or-later
"""Says which locked packages have newer releases (make outdated), and which of them are held back on purpose.

    python scripts/outdated.py [NAME ...]

Asks pip about each package of the locks, changes nothing, and needs the registry. Held back is what the table
of docs/pins.md names. Exit code 0: newer ones are news, no fault; 1 where the registry does not answer.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import lock
from packaging.version import Version

PAGE = Path(__file__).resolve().parents[1] / "docs" / "pins.md"
AT_ONCE = 4
"""Questions to the registry."""


@dataclass(frozen=True)
class Newer:
    """A package of which this Python could have another version than is locked."""

    name: str
    locked: str
    newest: str
    locks: tuple[str, ...]


def held_back() -> set[str]:
    """Names of the packages in the first column of the tables of docs/pins.md."""
    rows = re.findall(r"^\| ([^|]+?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {lock.normalised(word) for row in rows for word in re.findall(r"[A-Za-z][\w-]*", row)}


def newest(name: str) -> str:
    """The newest release for this Python, as pip sees it. ValueError: pip has no answer."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "index", "versions", name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.match(r"\S+ \((\S+)\)", done.stdout)
    if found is None:
        last = done.stderr.strip().rpartition("\n")[2] or "it said nothing"
        raise ValueError(f"pip knows nothing of {name}: {last}")
    return found[1]


def outdated(names: Sequence[str]) -> Iterator[Newer]:
    """Of these locks; what several lock is asked for once."""
    where: dict[tuple[str, str], list[str]] = {}
    for name in names:
        for package, (version, _) in lock.read_lock(lock.lock_file(name)).items():
            where.setdefault((package, version), []).append(name)
    pins = sorted(where)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for (package, version), now in zip(pins, pool.map(newest, [one for one, _ in pins]), strict=True):
            if Version(now) > Version(version):
                yield Newer(package, version, now, tuple(where[package, version]))


def main() -> int:
    """Print a line a package."""
    names = sys.argv[1:] or list(lock.PARTS)
    unknown = sorted(set(names) - set(lock.PARTS))
    if unknown:
        sys.exit(f"outdated.py: no lock {', '.join(unknown)}; expected {', '.join(lock.PARTS)}")
    held, found = held_back(), []
    try:
        for one in outdated(names):
            found.append(one)
            note = "  held back: docs/pins.md" if one.name in held else ""
            locks = ", ".join(one.locks)
            print(f"{one.name:28} {one.locked:18} -> {one.newest:18} ({locks}){note}", flush=True)
    except ValueError as error:
        print(f"outdated.py: {error}", file=sys.stderr)
        return 1
    free = sum(one.name not in held for one in found)
    print(f"{len(found)} have newer releases, {len(found) - free} are held back; make lock takes what goes")
    return 0


if __name__ == "__main__":
    sys.exit(main())

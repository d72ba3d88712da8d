#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes what CHANGELOG.md calls unreleased a version with a date, and tags it (make release).

    python scripts/release.py 0.2.0 [--sign]

Writes the version and the heading, commits both and tags the commit as vX.Y.Z with the topics of the
changelog. Refuses, with nothing changed, where files are not committed, nothing is unreleased, the version
is not above the one before, or its tag is there. Pushing and uploading stay with whoever releases:
CONTRIBUTING.md.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
from pathlib import Path

from packaging.version import InvalidVersion, Version

ROOT = Path(__file__).resolve().parents[1]
UNRELEASED = "## Unreleased"
RELEASED = re.compile(r"^## (\d+\.\d+\.\d+), (\d{4}-\d{2}-\d{2})$", re.MULTILINE)
"""A heading of CHANGELOG.md."""
VERSION = re.compile(r'^__version__ = "(.*)"$', re.MULTILINE)
"""In generator/__init__.py, from which everything else follows."""


class ReleaseError(Exception):
    """Why there is no release: one line."""


def git(root: Path, *arguments: str) -> str:
    """What git prints. Raises ReleaseError with git's own last line."""
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReleaseError((done.stderr or done.stdout).strip().rpartition("\n")[2])
    return done.stdout


def release(version: str, root: Path, *, day: datetime.date, sign: bool = False) -> str:
    """Make the release of a checkout and return its tag. Raises ReleaseError, with nothing changed."""
    changes, source = root / "CHANGELOG.md", root / "generator" / "__init__.py"
    text, code = changes.read_text(encoding="utf-8"), source.read_text(encoding="utf-8")
    before = [Version(found[0]) for found in RELEASED.findall(text)]
    try:
        if not re.fullmatch(r"\d+\.\d+\.\d+", version) or any(Version(version) <= one for one in before):
            raise InvalidVersion
    except InvalidVersion:
        after = f" above {max(before)}" if before else ""
        raise ReleaseError(f"{version!r} is no version X.Y.Z{after}") from None
    _, heading, rest = text.partition(f"{UNRELEASED}\n")
    unreleased = re.split(r"^## ", rest, maxsplit=1, flags=re.MULTILINE)[0]
    topics = re.findall(r"^### (.+)$", unreleased, re.MULTILINE)
    if not heading or not topics:
        raise ReleaseError(f"CHANGELOG.md has no topics below {UNRELEASED!r}: there is nothing to release")
    if git(root, "status", "--porcelain").strip():
        raise ReleaseError("files are not committed; a release is a commit that CI has seen")
    tag = f"v{version}"
    if git(root, "tag", "--list", tag).strip():
        raise ReleaseError(f"{tag} is there already")
    dated = f"{UNRELEASED}\n\n## {version}, {day.isoformat()}\n"
    changes.write_text(text.replace(f"{UNRELEASED}\n", dated, 1), encoding="utf-8")
    source.write_text(VERSION.sub(f'__version__ = "{version}"', code), encoding="utf-8")
    git(root, "commit", "--quiet", "--message", f"Release {version}", "--", str(changes), str(source))
    notes = "\n".join([f"Headturn {version}", "", *(f"- {topic}" for topic in topics)])
    git(root, "tag", "--sign" if sign else "--annotate", tag, "--message", notes)
    return tag


def main() -> None:
    """Release, and say what is left to do."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("version", help="X.Y.Z")
    parser.add_argument("--sign", action="store_true", help="sign the tag with your key")
    given = parser.parse_args()
    try:
        tag = release(given.version, ROOT, day=datetime.date.today(), sign=given.sign)
    except ReleaseError as error:
        parser.exit(1, f"release.py: {error}\n")
    print(f"{tag}: now .ci/run, make dist, git push --follow-tags")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders that are kept for later, within a limit."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def make_room(places: Iterable[Path], limit: int) -> None:
    """Remove what lies in these folders, the longest unused first, until limit bytes are left of it.

    Used is what :func:`use` was called with.
    """
    there = [(entry.stat().st_mtime, size(entry), entry) for place in places for entry in place.iterdir()]
    total = sum(taken for _, taken, _ in there)
    for _, taken, entry in sorted(there):
        if total <= limit:
            return
        total -= taken
        shutil.rmtree(entry, ignore_errors=True)


def use(folder: Path) -> None:
    """Remember that this was used now."""
    with suppress(OSError):  # another user's, whose times are his
        os.utime(folder)


def size(folder: Path) -> int:
    """Bytes of all files below a folder."""
    total = 0
    for path, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):  # another Blender may tidy up, too
                total += os.lstat(os.path.join(path, name)).st_size
    return total

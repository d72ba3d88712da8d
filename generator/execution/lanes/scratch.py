# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder for frames in flight: on a tmpfs where the system has one."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from generator.process import is_running

_TMPFS = Path("/dev/shm")
_PREFIX = "headturn-"
ENOUGH = 512 * 2**20
"""Bytes that must be free on a tmpfs; a container's is often 64 MB, less than one large head."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder of this process's own, removed at the end; leftovers of dead processes go too."""
    remove_leftovers()
    base = _base()
    folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-", dir=base))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers() -> None:
    """Remove the folders of processes that were killed."""
    for left in _base().glob(f"{_PREFIX}*-*"):
        pid = left.name.removeprefix(_PREFIX).split("-")[0]
        if pid.isdigit() and not is_running(int(pid)):
            shutil.rmtree(left, ignore_errors=True)


def _base() -> Path:
    if _TMPFS.is_dir() and os.access(_TMPFS, os.W_OK) and shutil.disk_usage(_TMPFS).free >= ENOUGH:
        return _TMPFS
    return Path(tempfile.gettempdir())

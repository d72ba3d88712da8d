# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder for frames in flight: on a tmpfs where the system has one."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from generator.locks import NoLocks, try_lock

_TMPFS = Path("/dev/shm")
_PREFIX = "headturn-"
_LOCK = ".in-use"
ENOUGH = 512 * 2**20
"""Bytes that must be free on a tmpfs; a container's is often 64 MB, less than one large head."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder of this process's own, removed at the end; leftovers of dead processes go too.

    A lock in it says that it is in use. Containers that share the tmpfs do not see each other's processes.
    """
    remove_leftovers()
    folder, lock = _locked_folder(frames_folder())
    try:
        yield folder
    finally:
        if lock is not None:
            lock.close()
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers() -> None:
    """Remove the folders of processes that were killed."""
    for left in frames_folder().glob(f"{_PREFIX}*-*"):
        with suppress(OSError):  # somebody else's, gone by now, or with no lock that could tell
            if not _is_ours(left):
                continue
            with (left / _LOCK).open("r+b") as file:
                if try_lock(file):
                    shutil.rmtree(left, ignore_errors=True)


def _locked_folder(base: Path) -> tuple[Path, BinaryIO | None]:
    while True:
        folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-", dir=base))
        file = (folder / _LOCK).open("x+b")
        try:
            ours = try_lock(file)
        except NoLocks:
            # Without the file nobody takes the folder for a leftover; if we are killed, it stays.
            file.close()
            (folder / _LOCK).unlink()
            return folder, None
        # Before it was locked another process could take it for a leftover.
        if ours and (folder / _LOCK).exists():
            return folder, file
        file.close()


def _is_ours(folder: Path) -> bool:
    """A folder, no link, of this user."""
    status = folder.lstat()
    return stat.S_ISDIR(status.st_mode) and (not hasattr(os, "getuid") or status.st_uid == os.getuid())


def frames_folder() -> Path:
    """The folder that scratch folders are made in."""
    if _TMPFS.is_dir() and os.access(_TMPFS, os.W_OK) and shutil.disk_usage(_TMPFS).free >= ENOUGH:
        return _TMPFS
    return Path(tempfile.gettempdir())

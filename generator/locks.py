# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks on files that the operating system frees when their holder dies, however it dies. stdlib only.

They hold between containers that share a folder, where a process id means nothing: each has its own.
"""

from __future__ import annotations

import errno
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

LOOK_S = 0.2
"""Between two looks whether somebody else has done."""

NO_LOCKS = {
    getattr(errno, name)
    for name in ("ENOLCK", "ENOTSUP", "EOPNOTSUPP", "ENOSYS", "EINVAL")
    if hasattr(errno, name)
}
"""What a file system says that has none."""

if sys.platform == "win32":
    import msvcrt

    def _lock(file: BinaryIO) -> None:
        # Far beyond what is written, so that others can still read who holds it.
        file.seek(2**30)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        file.seek(0)
else:
    import fcntl

    def _lock(file: BinaryIO) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class NoLocks(OSError):
    """The file system has no locks."""


def try_lock(file: BinaryIO) -> bool:
    """Lock an open file until it is closed; False if another process holds it. NoLocks: see there."""
    try:
        _lock(file)
    except OSError as error:
        if error.errno in NO_LOCKS:
            raise NoLocks(error.errno, error.strerror) from error
        if isinstance(error, (BlockingIOError, PermissionError)):
            return False
        raise
    return True


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """A block that one process at a time enters, others after it; where there are no locks, all at once.

    path: of a file that is left behind. Raises OSError if it cannot be written.
    """
    with path.open("ab") as file:
        try:
            while not try_lock(file):
                time.sleep(LOOK_S)
        except NoLocks:
            pass
        yield

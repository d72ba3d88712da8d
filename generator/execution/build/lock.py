# SPDX-License-Identifier: GPL-3.0-or-later
"""One build a folder: a lock that the operating system frees when its holder dies."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from generator.errors import DatasetError
from generator.reading import MAX_CONFIG_BYTES, parse_json, read_limited

LOCK_FILE = ".lock"

if sys.platform == "win32":
    import msvcrt

    def _try_lock(file: BinaryIO) -> None:
        # Far beyond what is written, so that others can still read who holds it.
        file.seek(2**30)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        file.seek(0)
else:
    import fcntl

    def _try_lock(file: BinaryIO) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def locked(root: Path) -> Iterator[None]:
    """Hold the folder root, which must exist, for this process alone.

    A file left behind by a process that was killed is no hindrance: the lock is
    the operating system's, the file only says who holds it.
    Raises DatasetError if another process holds it, or root cannot be written.
    """
    path = root / LOCK_FILE
    try:
        file = _open_locked(path)
    except BlockingIOError as error:
        raise DatasetError(_refusal(root, path)) from error
    except OSError as error:
        if sys.platform == "win32" and isinstance(error, PermissionError) and path.exists():
            raise DatasetError(_refusal(root, path)) from error
        raise DatasetError(f"{root}: cannot write there ({error.strerror}); choose another --out") from error
    with file:
        holder = {"pid": os.getpid(), "host": socket.gethostname()}
        file.truncate()
        file.write(json.dumps(holder).encode())
        file.flush()
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # Windows removes no open file; it does no harm there
                path.unlink()


def _open_locked(path: Path) -> BinaryIO:
    while True:
        file = path.open("r+b") if path.exists() else path.open("w+b")
        try:
            _try_lock(file)
            # The holder before us may have removed the file between our opening and locking it.
            if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except BaseException:
            file.close()
            raise
        file.close()


def _refusal(root: Path, path: Path) -> str:
    try:
        holder = parse_json(read_limited(path, MAX_CONFIG_BYTES))
        who = f" (process {holder['pid']} on {holder['host']})"
    except (OSError, ValueError, KeyError, TypeError):
        who = ""
    return f"{root}: another build{who} is at work there; wait for its end or choose another --out"

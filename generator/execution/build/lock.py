# SPDX-License-Identifier: GPL-3.0-or-later
"""One build a folder: a lock that the operating system frees when its holder dies."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from generator.dataset.format.files import check_there
from generator.errors import DatasetError
from generator.locks import NoLocks, try_lock
from generator.process import is_running
from generator.reading import MAX_CONFIG_BYTES, parse_json, read_limited

LOCK_FILE = ".lock"


class Lock:
    """A folder that is held. note: what its file system lacks; "" if nothing."""

    def __init__(self, root: Path, file: BinaryIO, note: str) -> None:
        self._root, self._file, self.note = root, file, note
        self._folder = root.stat()

    def check(self) -> None:
        """Raises DatasetError if the folder is no longer the one that is held."""
        check_there(self._root)
        # Either may change its number on file systems that make numbers up.
        if not os.path.samestat(self._folder, self._root.stat()) and not self._is_there():
            raise DatasetError(
                f"{self._root}: this folder was replaced by another one while the build was at work; "
                "nothing more is written there"
            )

    def free(self) -> None:
        """Let others have the folder."""
        with contextlib.suppress(OSError):  # Windows removes no open file; it does no harm there
            if self._is_there():
                (self._root / LOCK_FILE).unlink()
        self._file.close()

    def _is_there(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), (self._root / LOCK_FILE).stat())
        except FileNotFoundError:
            return False


@contextlib.contextmanager
def locked(root: Path) -> Iterator[Lock]:
    """Hold the folder root, which must exist, for this process alone.

    A file left behind by a process that was killed is no hindrance: the lock is the operating system's, the
    file only says who holds it. Where the file system has no locks, the file itself is the lock.
    Raises DatasetError if another process holds it, or root cannot be written.
    """
    path = root / LOCK_FILE
    try:
        file, note = _open_locked(path)
    except OSError as error:
        raise DatasetError(f"{root}: cannot write there ({error.strerror}); choose another --out") from error
    lock = Lock(root, file, note)
    try:
        file.truncate()
        file.write(json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode())
        file.flush()
        yield lock
    finally:
        lock.free()


def _open_locked(path: Path) -> tuple[BinaryIO, str]:
    while True:
        try:
            file, new = path.open("x+b"), True
        except FileExistsError:
            file, new = path.open("r+b"), False
        try:
            if not try_lock(file):
                raise DatasetError(_refusal(path))
            # The holder before us may have removed the file between our opening and locking it.
            if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file, ""
        except NoLocks as error:
            if new:
                why = f"{path.parent}: no locks there ({error.strerror})"
                return file, f"{why}; the file {LOCK_FILE} takes their place"
            file.close()
            _remove_left(path)
        except BaseException:
            file.close()
            raise
        file.close()


def _remove_left(path: Path) -> None:
    """Remove the file of a process that has ended. DatasetError if it has not, or nobody here knows."""
    holder = _holder(path)
    pid = holder.get("pid")
    if holder.get("host") != socket.gethostname() or not isinstance(pid, int):
        raise DatasetError(
            f"{_refusal(path)}. There are no locks, so nobody knows whether it still runs: "
            f"if it does not, delete {path}"
        )
    if is_running(pid):
        raise DatasetError(f"{_refusal(path)}. If that process is something else, delete {path}")
    path.unlink(missing_ok=True)


def _holder(path: Path) -> dict[str, object]:
    try:
        holder = parse_json(read_limited(path, MAX_CONFIG_BYTES))
    except (OSError, ValueError):
        return {}
    return holder if isinstance(holder, dict) else {}


def _refusal(path: Path) -> str:
    holder = _holder(path)
    who = f" (process {holder['pid']} on {holder['host']})" if {"pid", "host"} <= set(holder) else ""
    return f"{path.parent}: another build{who} is at work there; wait for its end or choose another --out"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are either complete or not there."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO, TypeVar

import pyarrow as pa

from generator.errors import DatasetError

T = TypeVar("T")


def write_atomically(path: Path, write: Callable[[BinaryIO], object], check: Callable[[Path], T]) -> T:
    """Write a file under a temporary name, check it and move it into place.

    write fills the open file; check reads the closed file back under its
    temporary name ``.<stem>.tmp``, and what it returns is returned. After a
    crash at any point, path is the old file or the whole new one.

    Raises
    ------
    DatasetError: the disk is full, the folder is not writable, or check refused;
        nothing is left behind.
    """
    temporary = path.with_name(f".{path.stem}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        result = check(temporary)
        temporary.replace(path)
        _sync_folder(path.parent)
    except (OSError, pa.ArrowException) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error)
        raise DatasetError(
            f"{path}: cannot be written ({reason}); free some disk space or check the permissions"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return result


def write_bytes(path: Path, content: bytes) -> None:
    """Write bytes atomically. Raises DatasetError as :func:`write_atomically` does."""
    write_atomically(path, lambda file: file.write(content), lambda _: None)


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Write many files, and wait for the disk once all are written rather than after each.

    Not atomic: for files that count only once something written later says so.
    Raises DatasetError as :func:`write_atomically` does.
    """
    path = Path()
    try:
        for path, content in contents.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)  # it may be linked into a compacted dataset
            path.write_bytes(content)
        for path in contents:
            _sync(path)
        for path in {path.parent for path in contents}:
            _sync_folder(path)
    except OSError as error:
        raise DatasetError(
            f"{path}: cannot be written ({error.strerror}); free some disk space or check the permissions"
        ) from error


def append_line(path: Path, line: str) -> None:
    """Add a line to a file whose last line a crash may have cut short.

    Raises DatasetError if it cannot be written.
    """
    try:
        with path.open("ab+") as file:
            if file.seek(0, os.SEEK_END):
                file.seek(-1, os.SEEK_END)
                if file.read() != b"\n":
                    file.write(b"\n")
            file.write(line.encode() + b"\n")
    except OSError as error:
        raise DatasetError(
            f"{path}: cannot be written ({error.strerror}); free some disk space or check the permissions"
        ) from error


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, hex. Raises OSError if it cannot be read."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
    return digest.hexdigest()


def one_line(error: BaseException) -> str:
    """The first sentence of an error of a library, on one line."""
    return " ".join(str(error).split(". ")[0].split())


def _sync_folder(folder: Path) -> None:
    if os.name == "posix":  # Windows has no handle for a folder; its rename is durable by itself
        _sync(folder)


def _sync(path: Path) -> None:
    # Windows flushes only what is open for writing.
    handle = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

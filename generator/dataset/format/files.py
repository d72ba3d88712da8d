# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are either complete or not there."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO, TypeVar

import pyarrow as pa

from generator.errors import DatasetError
from generator.reading import check_regular

T = TypeVar("T")


NOT_KNOWN = {
    getattr(errno, name)
    for name in ("EINVAL", "ENOTSUP", "EOPNOTSUPP", "ENOSYS", "ENOTTY", "EISDIR")
    if hasattr(errno, name)
}
"""What a file system says that cannot wait for its disk."""

NOT_FOR_FOLDERS = NOT_KNOWN | {errno.EACCES, errno.EPERM, errno.EBADF}
"""The same, of a folder."""


def write_atomically(
    path: Path,
    write: Callable[[BinaryIO], object],
    check: Callable[[Path], T],
    root: Path | None = None,
) -> T:
    """Write a file under a temporary name, check it and move it into place.

    root: a folder above it, below which folders are made; by default the file's own. It must be there:
    a dataset that somebody moves while it is built does not come into being a second time.

    write fills the open file; check reads the closed file back under its
    temporary name ``.<stem>.tmp``, and what it returns is returned. After a
    crash at any point, path is the old file or the whole new one.

    Raises
    ------
    DatasetError: the disk is full, the folder is not writable, or check refused;
        nothing is left behind.
    """
    temporary = path.with_name(f".{path.stem}.tmp")
    root = root or path.parent
    try:
        _make_folder(path.parent, root)
        with temporary.open("wb") as file:
            write(file)
            file.flush()
            _to_disk(file.fileno())
        result = check(temporary)
        temporary.replace(path)
        _sync_folder(path.parent)
    except (OSError, pa.ArrowException) as error:
        check_there(root)
        reason = error.strerror if isinstance(error, OSError) and error.strerror else one_line(error)
        raise DatasetError(
            f"{path}: cannot be written ({reason}); free some disk space or check the permissions"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return result


def write_bytes(path: Path, content: bytes, root: Path | None = None) -> None:
    """Write bytes atomically. Raises DatasetError as :func:`write_atomically` does."""
    write_atomically(path, lambda file: file.write(content), lambda _: None, root)


def write_anywhere(path: Path, content: bytes) -> None:
    """As :func:`write_bytes`, where a user wants a file: folders that are missing are made."""
    path = path.absolute()
    write_bytes(path, content, Path(path.anchor))


def write_files(contents: Mapping[Path, bytes], root: Path) -> None:
    """Write many files, and wait for the disk once all are written rather than after each.

    root: the folder above them, which must be there. Not atomic: for files that count only once something
    written later says so.
    Raises DatasetError as :func:`write_atomically` does.
    """
    path = Path()
    try:
        for path, content in contents.items():
            _make_folder(path.parent, root)
            path.unlink(missing_ok=True)  # it may be linked into a compacted dataset
            path.write_bytes(content)
        for path in contents:
            _sync(path)
        for path in {path.parent for path in contents}:
            _sync_folder(path)
    except OSError as error:
        check_there(root)
        raise DatasetError(
            f"{path}: cannot be written ({error.strerror}); free some disk space or check the permissions"
        ) from error


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, if they are missing. Raises DatasetError if it cannot."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be made ({error.strerror}); check the permissions") from error


def check_there(root: Path) -> None:
    """Raises DatasetError if the folder root is gone."""
    if not root.is_dir():
        raise DatasetError(
            f"{root}: this folder was moved, renamed or deleted while files were written there; "
            "put it back and run the same command again"
        )


def unsynced(folder: Path) -> str:
    """Why this file system cannot say that a new file's name is on the disk; "" if it can."""
    try:
        if os.name == "posix":
            _open_and(os.fsync, folder)
    except OSError as error:
        return error.strerror or str(error)
    return ""


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
    """SHA-256 of a file's bytes, hex. Raises OSError if it is no regular file or cannot be read."""
    digest = hashlib.sha256()
    check_regular(path, sys.maxsize)
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
    return digest.hexdigest()


def one_line(error: BaseException) -> str:
    """The first sentence of an error of a library, on one line."""
    return " ".join(str(error).split(". ")[0].split())


def _make_folder(folder: Path, root: Path) -> None:
    """Make folder, which is root or lies below it; FileNotFoundError if root is gone."""
    for name in reversed([folder, *folder.parents]):
        if root in name.parents and not name.is_dir():
            name.mkdir(exist_ok=True)


def _sync_folder(folder: Path) -> None:
    # Windows has no handle for a folder; its rename is durable by itself. Nor has many a network or FUSE file
    # system: there a power cut may take the last files, which receipts and verify notice.
    if os.name == "posix":
        try:
            _open_and(os.fsync, folder)
        except OSError as error:
            if error.errno not in NOT_FOR_FOLDERS:
                raise


def _sync(path: Path) -> None:
    _open_and(_to_disk, path)


def _open_and(sync: Callable[[int], None], path: Path) -> None:
    # Windows flushes only what is open for writing.
    handle = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        sync(handle)
    finally:
        os.close(handle)


def _to_disk(handle: int) -> None:
    """fsync; where there is none the file is written all the same. Raises OSError: it is not."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in NOT_KNOWN:
            raise

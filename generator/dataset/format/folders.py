# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset's folder beside another one: complete or not there, its large files shared where they can be."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from generator.errors import DatasetError
from generator.reading import check_regular


@contextmanager
def folder_beside(source: Path, target: Path) -> Iterator[Path]:
    """A hidden folder that takes the name target when the block ends without an error.

    Raises DatasetError: target exists or lies inside of source, or it cannot be written;
    nothing is left behind.
    """
    if target.exists():
        raise DatasetError(f"{target} exists; choose another --out")
    if source in target.parents:
        raise DatasetError(f"{target} lies inside of {source}; choose another --out")
    work = target.with_name(f".{target.name}.tmp")
    shutil.rmtree(work, ignore_errors=True)
    try:
        work.mkdir(parents=True)
        yield work
        work.rename(target)
    except OSError as error:
        reason = f"cannot be written ({error.strerror}); free some disk space or check the permissions"
        raise DatasetError(f"{target}: {reason}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def share_files(source: Path, target: Path, without: Collection[str]) -> None:
    """Give target what lies in source, besides the named files and what is hidden.

    Folders hold files that are never changed in place: they are linked, or copied where the disk has no
    links. Files beside them may grow, such as logs: they are copied. Raises OSError; DatasetError: a link
    leads out of source, or something there is neither file nor folder.
    """
    for path in sorted(source.iterdir()):
        if path.name in without or path.name.startswith("."):
            continue
        _check_plain(path, source)
        if path.is_dir():
            shutil.copytree(path, target / path.name, copy_function=_link_file)
        else:
            check_regular(path, sys.maxsize)
            shutil.copy2(path, target / path.name)


def _check_plain(path: Path, root: Path) -> None:
    """Raises DatasetError unless all in path is files, folders, and links that stay inside of root."""
    inside = [path]
    if path.is_dir() and not path.is_symlink():
        inside += [Path(at) / name for at, folders, files in os.walk(path) for name in (*folders, *files)]
    for entry in inside:
        if entry.is_symlink() and not entry.resolve().is_relative_to(root.resolve()):
            raise DatasetError(f"{entry}: a link out of the dataset; put the file itself there, or remove it")
        if not (entry.is_dir() or entry.is_file()):
            raise DatasetError(f"{entry}: neither a file nor a folder; remove it")


def _link_file(path: str, target: str) -> None:
    check_regular(Path(path), sys.maxsize)  # a device has no end
    try:
        os.link(path, target)
    except OSError:
        shutil.copy2(path, target)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder that is either complete or not there."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from generator.errors import DatasetError, UsageError


@contextmanager
def new_folder(target: Path, dataset: Path) -> Iterator[Path]:
    """A temporary folder beside target, moved into its place if the block ends without an error.

    Raises
    ------
    UsageError: target is not empty, not a folder, or inside the dataset.
    DatasetError: the disk is full or the place is not writable; nothing is left behind.
    """
    target = Path(target)
    _check(target, dataset)
    temporary = target.with_name(f".{target.name}.export.tmp")
    try:
        if temporary.exists():  # of an export that was killed
            shutil.rmtree(temporary)
        temporary.mkdir(parents=True)
        yield temporary
        if target.exists():
            target.rmdir()
        os.replace(temporary, target)
    except OSError as error:
        raise DatasetError(
            f"{target}: cannot be written ({error.strerror or error}); free some disk space or check the "
            "permissions"
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _check(target: Path, dataset: Path) -> None:
    if target.exists() and not target.is_dir():
        raise UsageError(f"{target}: is a file; name a folder that is new or empty")
    if target.is_dir() and any(target.iterdir()):
        raise UsageError(f"{target}: the folder is not empty; name one that is new or empty")
    if target.resolve().is_relative_to(dataset.resolve()):
        raise UsageError(f"{target}: lies inside the dataset {dataset}; name a folder outside of it")

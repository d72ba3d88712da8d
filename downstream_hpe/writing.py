# SPDX-License-Identifier: MIT
"""What writes files: a full disk, or a folder that may not be written to, is one line that names them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from downstream_hpe.errors import DataError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """DataError with the name of a file or folder; what a full disk makes of a write has none."""
    try:
        yield
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error

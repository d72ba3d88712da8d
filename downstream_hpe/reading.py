# SPDX-License-Identifier: MIT
"""Files of strangers, read with limits: regular files, of a stated size, not nested without end.

A pipe would wait for ever, and /dev/zero has no end. What is refused is an OSError or a ValueError.
"""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

MAX_TEXT_BYTES = 1 << 22
MAX_STATE_BYTES = 1 << 30
"""Of a manifest, which grows with its dataset."""


def check_regular(path: Path, limit: int) -> int:
    """The size of a regular file of at most limit bytes.

    Raises OSError: it is not there, or no regular file; ValueError: it is larger.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(0, "not a regular file", str(path))
    if status.st_size > limit:
        raise ValueError(f"larger than {limit:,} bytes")
    return status.st_size


def read_limited(path: Path, limit: int) -> bytes:
    """The bytes of a regular file. Raises as :func:`check_regular` does."""
    size = check_regular(path, limit)
    # A file may be another by now: neither a pipe nor a device is waited for or read without end.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        # Not limit at once: room is made for as much as is asked for.
        data = file.read(size + 1)
        while len(data) <= limit and (more := file.read(1 << 20)):
            data += more
    if len(data) > limit:
        raise ValueError(f"larger than {limit:,} bytes")
    return data


def parse_json(text: str | bytes) -> Any:
    """JSON that may come from anyone. Raises ValueError: it is none, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error

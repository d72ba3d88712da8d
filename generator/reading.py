# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of strangers, read with limits: regular files, of a stated size, not nested without end. stdlib only.

A pipe would wait for ever, /dev/zero has no end, and 200,000 brackets end in an error that nobody
expects of JSON. Whatever is refused here is an OSError or a ValueError, so that a reader that turns
these into its one line needs to know of nothing else.
"""

from __future__ import annotations

import json
import os
import re
import stat
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

# In Blender's Python, which is 3.11 or later, there is no tomli, and in 3.10 there is nothing else.
tomllib: Any = import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")

MAX_STATE_BYTES = 1 << 30
"""Of a file of ours that grows with the dataset: a manifest of a million parts has a third of this."""

MAX_CONFIG_BYTES = 1 << 22

MAX_DOTS = 100
"""Of a key in TOML."""

_TOML_STRING = re.compile(r"\"[^\"\n]*\"|'[^'\n]*'")
_TOML_MARK = re.compile(r"[.,=\n\[\]{}]")


def check_regular(path: Path, limit: int) -> int:
    """The size of a regular file of at most limit bytes.

    Raises OSError: it is not there, or no regular file; ValueError: it is larger.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(0, "not a regular file", str(path))
    if status.st_size > limit:
        raise ValueError(f"has {status.st_size} bytes, more than the {limit} that such a file may have")
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
        raise ValueError(f"has more than the {limit} bytes that such a file may have")
    return data


def read_text(path: Path, limit: int) -> str:
    """The UTF-8 text of a regular file. Raises as :func:`check_regular` does, ValueError for other bytes."""
    return read_limited(path, limit).decode("utf-8")


def parse_json(text: str | bytes) -> Any:
    """JSON that may come from anyone. Raises ValueError: it is none, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def parse_toml(text: str) -> dict[str, Any]:
    """TOML that may come from anyone. Raises ValueError: it is none, or nested too deeply."""
    # A key of n dots takes n^2 steps, and what it makes nobody could print.
    dots = 0
    for mark in _TOML_MARK.finditer(_TOML_STRING.sub("", text)):
        dots = dots + 1 if mark[0] == "." else 0
        if dots > MAX_DOTS:
            raise ValueError("nested too deeply")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error

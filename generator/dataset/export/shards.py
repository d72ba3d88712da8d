# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of a split that end when they are large: what streaming readers take one after another."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

SHARD_BYTES = 1 << 28
"""A shard ends with the first row that goes beyond it: 256 MiB, enough to stream, and little to wait for."""


@dataclass
class _Open:
    file: BinaryIO
    number: int


class Shards:
    """Shards of every split, opened as rows come.

    folder: where they lie. suffix: such as ".tar". end: called with a file before it is closed.
    """

    def __init__(self, folder: Path, suffix: str, end: Callable[[BinaryIO], object] = lambda _: None) -> None:
        self._folder, self._suffix, self._end = folder, suffix, end
        self._open: dict[str, _Open] = {}
        self._rows: dict[str, int] = {}

    def __enter__(self) -> Shards:
        return self

    def __exit__(self, *_: object) -> None:
        with ExitStack() as stack:
            for one in self._open.values():
                stack.callback(self._close, one)

    def file(self, split: str) -> BinaryIO:
        """Where the next row of a split goes. Raises OSError."""
        current = self._open.get(split)
        if current is not None and current.file.tell() >= SHARD_BYTES:
            self._close(current)
            current = _Open(self._new(split, current.number + 1), current.number + 1)
        current = current or _Open(self._new(split, 0), 0)
        self._open[split] = current
        self._rows[split] = self._rows.get(split, 0) + 1
        return current.file

    def table(self) -> str:
        """The shards and rows of each split, as Markdown."""
        lines = ["| split | shards | rows |", "|---|---|---|"]
        for split, current in sorted(self._open.items()):
            numbers = "000000" if not current.number else f"{{000000..{current.number:06d}}}"
            lines.append(f"| {split} | `{split}-{numbers}{self._suffix}` | {self._rows[split]} |")
        return "\n".join(lines)

    def _new(self, split: str, number: int) -> BinaryIO:
        return (self._folder / f"{split}-{number:06d}{self._suffix}").open("wb")

    def _close(self, one: _Open) -> None:
        try:
            self._end(one.file)
        finally:
            one.file.close()

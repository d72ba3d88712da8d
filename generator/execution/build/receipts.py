# SPDX-License-Identifier: GPL-3.0-or-later
"""Which units are done: plan minus valid parts, without reading every part from end to end."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

from generator.dataset.format.files import append_line, write_bytes
from generator.dataset.format.part import PartInfo, check_part
from generator.errors import DatasetError
from generator.messages import BuildOrder

RECEIPTS_FILE = "receipts.jsonl"


class Receipts:
    """What is known of the parts of a dataset in the making, one JSON line a part.

    A part whose size and time of change are those of its receipt is not read
    again. One without a receipt, or one that changed, is read from the first byte
    to the last, so losing the file costs time and nothing else.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._path = root / RECEIPTS_FILE
        self._known = _read(self._path)

    def valid_part(self, path: str, rows: int) -> PartInfo | None:
        """The part at path (relative to the dataset) if it is whole and has so many rows, else None."""
        file = self._root / path
        try:
            stamp = _stamp(file)
        except FileNotFoundError:
            return None
        part, known_stamp = self._known.get(path, (None, None))
        if part is None or known_stamp != stamp:
            try:
                part = check_part(file)
            except DatasetError:
                return None
            self._known[path] = part, stamp
        return part if part.rows == rows else None

    def head_of(self, path: str) -> tuple[str, str] | None:
        """(subject, expression) of a part, None if it cannot be read. One without a receipt is read."""
        part, _ = self._known.get(path, (None, None))
        if part is None:
            try:
                part = check_part(self._root / path)
            except DatasetError:
                return None
        return part.subject, part.expression

    def add(self, part: PartInfo) -> None:
        """Note a part that was just committed. Raises DatasetError if that cannot be written."""
        self._known[part.path] = part, _stamp(self._root / part.path)
        append_line(self._path, self._line(part.path))

    def keep(self, paths: Iterable[str]) -> None:
        """Write the file anew with the receipts of these parts alone."""
        write_bytes(self._path, "".join(self._line(path) + "\n" for path in paths).encode())

    def _line(self, path: str) -> str:
        part, stamp = self._known[path]
        return json.dumps({"part": asdict(part), "stamp": stamp})


def split_done(orders: Sequence[BuildOrder], receipts: Receipts) -> tuple[list[PartInfo], list[BuildOrder]]:
    """Parts that are already there and whole, and the orders still to be carried out."""
    done: list[PartInfo] = []
    todo: list[BuildOrder] = []
    for order in orders:
        part = receipts.valid_part(order.part_path, len(order.views))
        if part is None:
            todo.append(order)
        else:
            done.append(part)
    receipts.keep(part.path for part in done)
    return done, todo


def _read(path: Path) -> dict[str, tuple[PartInfo, list[int]]]:
    known = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                record = json.loads(line)
                part = PartInfo(**record["part"])
                known[part.path] = part, record["stamp"]
            except (ValueError, KeyError, TypeError):
                continue  # cut short by a crash: that part is read instead
    return known


def _stamp(path: Path) -> list[int]:
    status = os.stat(path)
    return [status.st_size, status.st_mtime_ns]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Which units are done: plan minus valid parts, without reading every part from end to end."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from generator.codec import from_plain
from generator.dataset.format.build_files import RECEIPTS_FILE
from generator.dataset.format.files import append_line, write_bytes
from generator.dataset.format.part import check_part
from generator.dataset.format.part_info import PartInfo
from generator.errors import DatasetError
from generator.execution.build.unit_check import check_unit, unit_files
from generator.messages import BuildOrder
from generator.sealed import read_sealed_lines, sealed_line

Stamp = list[Any]
"""Size and time of change of a part, and one digest of those of its images and passes."""


class Receipts:
    """What is known of the parts of a dataset in the making, one sealed JSON line a part.

    A part that is, with its images, of the size and the time of change of its receipt is not
    read again. One without a receipt, or one that changed, is read from the first byte to the
    last and compared with its order, so losing the file costs time and nothing else.

    refused: why parts that are there cannot stay, by their path.
    Raises DatasetError if the file is there and cannot be read.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._path = root / RECEIPTS_FILE
        self._known = dict(_read(self._path))
        self.refused: dict[str, str] = {}

    def valid_part(self, path: str, order: BuildOrder) -> PartInfo | None:
        """The part at path (relative to the dataset) if it is what the order would make, else None."""
        if not (self._root / path).exists():
            return None
        part, known_stamp = self._known.get(path, (None, None))
        stamp = self._stamp(path, order)
        if part is None or known_stamp != stamp:
            try:
                found = check_unit(self._root, path, order)
                if part is not None and found.sha256 != part.sha256:
                    raise DatasetError(f"{path}: is not the file that was committed (SHA-256 differs)")
            except DatasetError as error:
                self.refused[path] = str(error)
                return None
            part = found
            self._known[path] = part, stamp
        if part.rows != len(order.views):
            self.refused[path] = f"{path}: has {part.rows} rows, expected {len(order.views)}"
            return None
        return part

    def head_of(self, path: str) -> tuple[str, str] | None:
        """(subject, expression) of a part, None if it cannot be read. One without a receipt is read."""
        part, _ = self._known.get(path, (None, None))
        if part is None:
            try:
                part = check_part(self._root / path)
            except DatasetError:
                return None
        return part.subject, part.expression

    def add(self, part: PartInfo, order: BuildOrder) -> None:
        """Note a part that was just committed. Raises DatasetError if that cannot be written."""
        self._known[part.path] = part, self._stamp(part.path, order)
        append_line(self._path, self._line(part.path))

    def keep(self, paths: Iterable[str]) -> None:
        """Write the file anew with the receipts of these parts alone."""
        write_bytes(self._path, "".join(self._line(path) + "\n" for path in paths).encode())

    def _line(self, path: str) -> str:
        part, stamp = self._known[path]
        return sealed_line({"part": asdict(part), "stamp": stamp})

    def _stamp(self, path: str, order: BuildOrder) -> Stamp:
        status = os.stat(self._root / path)
        files = hashlib.sha256()
        for file in unit_files(order):
            try:
                of = os.stat(self._root / file)
            except FileNotFoundError:
                return []  # no receipt has this one: the part is read, which says what is missing
            files.update(f"{of.st_size} {of.st_mtime_ns}\n".encode())
        return [status.st_size, status.st_mtime_ns, files.hexdigest()]


def split_done(orders: Sequence[BuildOrder], receipts: Receipts) -> tuple[list[PartInfo], list[BuildOrder]]:
    """Parts that are already there and whole, and the orders still to be carried out."""
    done: list[PartInfo] = []
    todo: list[BuildOrder] = []
    for order in orders:
        part = receipts.valid_part(order.part_path, order)
        if part is None:
            todo.append(order)
        else:
            done.append(part)
    receipts.keep(part.path for part in done)
    return done, todo


def _read(path: Path) -> Iterator[tuple[str, tuple[PartInfo, Stamp]]]:
    try:
        for record in read_sealed_lines(path):
            part = from_plain(PartInfo, record["part"])
            yield part.path, (part, record["stamp"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(f"{path}: cannot be read ({error}); delete it and run the build again") from error

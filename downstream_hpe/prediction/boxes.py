# SPDX-License-Identifier: MIT
"""Boxes of faces that were found elsewhere, out of a .csv or .json file."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.landmarkers import Place
from downstream_hpe.reading import parse_json, read_limited

MAX_BYTES = 1 << 28
COLUMNS = ("picture", "x", "y", "w", "h")
FRAME = "frame"
EXPECTED = (
    "expected a .csv file with the columns picture,x,y,w,h or a .json list of objects with these: the path "
    "of a picture, and left, top, width and height of a face's box in pixels of the upright picture; of a "
    "video also frame, from 0"
)
FARTHEST = 1e6
"""Pixels."""


Box = tuple[float, float, float, float]
"""Left, top, width, height, pixels of the picture upright."""


@dataclass(frozen=True)
class Boxes:
    """found: a box a face, by the resolved path of a picture or video and by the frame, which is None of a
    picture. file: where they were read."""

    file: Path
    found: Mapping[Path, Mapping[int | None, list[Box]]]

    def places(self, path: Path, size: tuple[int, int]) -> dict[int | None, list[Place]]:
        """By the frame, centre [2] and longer side of each of a picture's or video's. size: its width and
        height.

        DataError: a box whose middle is not in the picture.
        """
        frames = self.found.get(path.resolve(), {})
        return {frame: [self._place(path, frame, size, box) for box in frames[frame]] for frame in frames}

    def _place(self, path: Path, frame: int | None, size: tuple[int, int], box: Box) -> Place:
        x, y, w, h = box
        centre = np.array([x + w / 2, y + h / 2])
        if not ((centre >= 0) & (centre < size)).all():
            of_frame = "" if frame is None else f" for frame {frame}"
            raise DataError(
                f"{path}: the box {x:g}, {y:g}, {w:g}, {h:g}{of_frame} of {self.file} is not in its "
                f"{size[0]} x {size[1]} pixels"
            )
        return centre, max(w, h)


def read_boxes(file: Path, every: Sequence[Source]) -> Boxes:
    """Boxes for the pictures and videos among the inputs.

    Each is named by its path from the current folder or from that of the file, or by as much of the end
    of its path as no other input has.

    Raises
    ------
    DataError: not readable, or not as EXPECTED. UsageError: another ending, a picture that is no input or
        several, or an input that is no file.
    """
    for source in every:
        if source.alone:
            raise UsageError(f"{source.name}: --boxes is for files, whose frames have numbers")
    moving = {Path(str(source.path)).resolve() for source in every if source.moving}
    paths = [Path(source.path) for source in every if isinstance(source.path, Path)]
    try:
        text = read_limited(file, MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror}); {EXPECTED}") from error
    except ValueError as error:
        raise DataError(f"{file}: not readable as boxes; {EXPECTED}") from error
    if file.suffix.lower() not in (".csv", ".json"):
        raise UsageError(f"{file}: {EXPECTED}")
    rows = _csv_rows(file, text) if file.suffix.lower() == ".csv" else _json_rows(file, text)
    inputs = _ByName(paths)
    found: dict[Path, dict[int | None, list[Box]]] = {}
    for where, row in rows:
        x, y, w, h = (_number(file, where, row, column) for column in COLUMNS[1:])
        if w <= 0 or h <= 0:
            raise DataError(f"{file}: {where}: w and h are {w:g} and {h:g}; {EXPECTED}")
        name = row.get("picture")
        if not isinstance(name, str) or not name:
            raise DataError(f"{file}: {where}: no picture; {EXPECTED}")
        path = inputs.named(file, where, name)
        frame = _frame(file, where, row, path in moving)
        found.setdefault(path, {}).setdefault(frame, []).append((x, y, w, h))
    return Boxes(file, found)


class _ByName:
    """Inputs by what a file may call them."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._resolved = {path.resolve() for path in paths}
        self._last: dict[str, list[Path]] = {}
        for path in self._resolved:
            self._last.setdefault(path.name, []).append(path)

    def named(self, file: Path, where: str, name: str) -> Path:
        """UsageError: none, or several."""
        given = Path(name)
        for exact in (given.resolve(), (file.parent / given).resolve()):
            if exact in self._resolved:
                return exact
        ending = given.parts
        alike = [path for path in self._last.get(given.name, []) if path.parts[-len(ending) :] == ending]
        if len(alike) != 1:
            what = "none" if not alike else f"{len(alike)}"
            raise UsageError(f"{file}: {where}: {name} is {what} of the inputs")
        return alike[0]


def _csv_rows(file: Path, text: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    reader = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        names = [name.strip() for name in reader.fieldnames or ()]
        missing = [column for column in COLUMNS if column not in names]
        if missing:
            raise DataError(f"{file}: has no column {', '.join(missing)}; {EXPECTED}")
        reader.fieldnames = names
        for row in reader:
            yield f"line {reader.line_num}", row
    except csv.Error as error:
        raise DataError(f"{file}: not readable as CSV ({error}); {EXPECTED}") from error


def _json_rows(file: Path, text: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    try:
        rows = parse_json(text)
    except ValueError as error:
        raise DataError(f"{file}: not readable as JSON; {EXPECTED}") from error
    if not isinstance(rows, list):
        raise DataError(f"{file}: {EXPECTED}")
    for number, row in enumerate(rows):
        if not isinstance(row, dict):
            raise DataError(f"{file}: entry {number}: no object; {EXPECTED}")
        yield f"entry {number}", row


def _frame(file: Path, where: str, row: Mapping[str, Any], moving: bool) -> int | None:
    value = row.get(FRAME)
    if not moving:
        if value not in (None, ""):
            raise DataError(f"{file}: {where}: {FRAME} is {value!r} of a picture; {EXPECTED}")
        return None
    number = _number(file, where, row, FRAME)
    if number < 0 or number != int(number):
        raise DataError(f"{file}: {where}: {FRAME} is {value!r}; {EXPECTED}")
    return int(number)


def _number(file: Path, where: str, row: Mapping[str, Any], column: str) -> float:
    value = row.get(column)
    try:
        number = float(value) if isinstance(value, str | int | float) and value is not True else np.nan
    except (ValueError, OverflowError):
        number = np.nan
    if not abs(number) < FARTHEST:
        raise DataError(f"{file}: {where}: {column} is {value!r}; {EXPECTED}")
    return number

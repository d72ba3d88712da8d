# SPDX-License-Identifier: MIT
"""One row a face: as a dictionary, a line of text, CSV or Parquet."""

from __future__ import annotations

import contextlib
import csv
import math
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from downstream_hpe.errors import UsageError
from downstream_hpe.escape import csv_text
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.prediction.face import Face
from downstream_hpe.writing import writing

COLUMN_TYPES = {
    "input": "string",  # the file, the address, webcam:N or stdin
    "frame": "int32",  # of a video, from 0; null for a picture
    "time_s": "double",
    "face": "int32",  # which face, or box; null where none is found
    "found": "bool",
    "yaw_deg": "double",
    "pitch_deg": "double",
    "roll_deg": "double",
    "confidence": "double",  # 0 to 1; null where the model gives none
    "in_range": "bool",  # among the angles the model was trained on
    "box_x": "double",  # around the landmarks, pixels
    "box_y": "double",
    "box_width": "double",
    "box_height": "double",
    "axis_yaw_deg": "double",  # relative to the optical axis
    "axis_pitch_deg": "double",
    "axis_roll_deg": "double",
    "x_mm": "double",  # the pivot from the camera, frame C; null where no place fits
    "y_mm": "double",
    "z_mm": "double",
    "focal_px": "double",
    "camera_guessed": "bool",
}
"""Of a file of rows, as Arrow names them."""
COLUMNS = tuple(COLUMN_TYPES)
_ANGLES, _BOX, _PLACE = COLUMNS[5:8], COLUMNS[10:14], COLUMNS[14:20]
ROWS_AT_ONCE = 1000

Record = dict[str, Any]


def record(
    name: str, frame: int | None, time_s: float | None, face: Face | None, box: int | None = None
) -> Record:
    """The row of a face, or of a picture or frame without one. box: in which of those that were given it was
    looked for."""
    row: Record = dict.fromkeys(COLUMNS)
    row.update(input=name, frame=frame, time_s=time_s, face=box, found=face is not None)
    if face is not None:
        row.update(face=face.index, in_range=face.in_range)
        row.update(zip(_ANGLES, (round(float(angle), 3) for angle in face.ypr_deg), strict=True))
        row.update(zip(_BOX, (round(float(side), 2) for side in face.box), strict=True))
        row["confidence"] = None if face.confidence is None else round(face.confidence, 4)
        if face.placed is not None:
            place = (*face.placed.ypr_deg, *face.placed.translation_mm)
            row.update(zip(_PLACE, (round(float(number), 3) for number in place), strict=True))
            row.update(focal_px=round(face.placed.focal_px, 2), camera_guessed=face.placed.guessed)
    return row


def text(row: Record, numbered: bool = False) -> str:
    """A row as people read it. numbered: with the index of the face, as there may be several."""
    where = row["input"] + (f" {row['time_s']:.2f} s" if row["frame"] is not None else "")
    if not row["found"]:
        return f"{where}: no face found" + ("" if row["face"] is None else f" in box {row['face']}")
    parts = [f"face {row['face']}"] if numbered else []
    parts += [f"{name} {row[f'{name}_deg']:.1f}" for name in ANGLES]
    if row["confidence"] is not None:
        parts.append(f"confidence {row['confidence']:.2f}")
    if row["z_mm"] is not None:
        about = "about " if row["camera_guessed"] else ""
        distance_mm = math.hypot(row["x_mm"], row["y_mm"], row["z_mm"])
        parts.append(f"{about}{distance_mm / 1000:.2f} m away")
    if not row["in_range"]:
        parts.append("outside the trained range")
    return f"{where}: {', '.join(parts)}"


class _ParquetFile:
    """Where rows go; pyarrow is imported for those alone who want such a file."""

    def __init__(self, path: Path) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in COLUMN_TYPES.items()])
        self._writer = pq.ParquetWriter(path, self._schema)
        self._table = pa.Table

    def write(self, rows: list[Record]) -> None:
        self._writer.write_table(self._table.from_pylist(rows, schema=self._schema))

    def close(self) -> None:
        self._writer.close()


class RecordWriter:
    """Writes rows to a .csv or .parquet file, by its suffix. Use it as a context manager.

    Raises
    ------
    UsageError: another suffix. DataError: the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rows: list[Record] = []
        self._stream: TextIO | None = None
        with writing(path):
            if path.suffix.lower() == ".csv":
                self._stream = path.open("w", newline="", encoding="utf-8")
                self._csv = csv.DictWriter(self._stream, COLUMNS, lineterminator="\n")
                self._csv.writeheader()
            elif path.suffix.lower() == ".parquet":
                self._parquet = _ParquetFile(path)
            else:
                raise UsageError(f"{path}: expected a .csv or .parquet file")

    def add(self, row: Record) -> None:
        """One row, in the order of calls. DataError: it cannot be written."""
        with writing(self._path):
            if self._stream is not None:
                self._csv.writerow({**row, "input": csv_text(row["input"])})
                return
            self._rows.append(row)
            if len(self._rows) == ROWS_AT_ONCE:
                self._flush()

    def _flush(self) -> None:
        self._parquet.write(self._rows)
        self._rows = []

    def __enter__(self) -> RecordWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with writing(self._path) if kind is None else contextlib.suppress(OSError):
            if self._stream is not None:
                self._stream.close()
                return
            if self._rows:
                self._flush()
            self._parquet.close()

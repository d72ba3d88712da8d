# SPDX-License-Identifier: MIT
"""One row a face: as a dictionary, a line of text, CSV or Parquet."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

import pyarrow as pa
import pyarrow.parquet as pq

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.escape import csv_text
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.prediction.face import Face

SCHEMA = pa.schema(
    [
        ("input", pa.string()),  # the file, or webcam:N
        ("frame", pa.int32()),  # of a video, from 0; null for a picture
        ("time_s", pa.float64()),
        ("face", pa.int32()),  # which face; null where none is found
        ("found", pa.bool_()),
        ("yaw_deg", pa.float64()),
        ("pitch_deg", pa.float64()),
        ("roll_deg", pa.float64()),
        ("confidence", pa.float64()),  # 0 to 1; null where the model gives none
        ("in_range", pa.bool_()),  # among the angles the model was trained on
        ("box_x", pa.float64()),  # around the landmarks, pixels
        ("box_y", pa.float64()),
        ("box_width", pa.float64()),
        ("box_height", pa.float64()),
        ("axis_yaw_deg", pa.float64()),  # relative to the optical axis
        ("axis_pitch_deg", pa.float64()),
        ("axis_roll_deg", pa.float64()),
        ("x_mm", pa.float64()),  # the pivot from the camera, frame C; null where no place fits
        ("y_mm", pa.float64()),
        ("z_mm", pa.float64()),
        ("focal_px", pa.float64()),
        ("camera_guessed", pa.bool_()),
    ]
)
COLUMNS = tuple(SCHEMA.names)
_ANGLES, _BOX, _PLACE = COLUMNS[5:8], COLUMNS[10:14], COLUMNS[14:20]
ROWS_AT_ONCE = 1000

Record = dict[str, Any]


def record(name: str, frame: int | None, time_s: float | None, face: Face | None) -> Record:
    """The row of a face, or of a picture or frame without one."""
    row: Record = dict.fromkeys(COLUMNS)
    row.update(input=name, frame=frame, time_s=time_s, found=face is not None)
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
        return f"{where}: no face found"
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
        try:
            if path.suffix == ".csv":
                self._stream = path.open("w", newline="", encoding="utf-8")
                self._csv = csv.DictWriter(self._stream, COLUMNS, lineterminator="\n")
                self._csv.writeheader()
            elif path.suffix == ".parquet":
                self._parquet = pq.ParquetWriter(path, SCHEMA)
            else:
                raise UsageError(f"{path}: expected a .csv or .parquet file")
        except OSError as error:
            raise DataError(f"{path}: cannot be written ({error.strerror})") from error

    def add(self, row: Record) -> None:
        """One row, in the order of calls."""
        if self._stream is not None:
            self._csv.writerow({**row, "input": csv_text(row["input"])})
            return
        self._rows.append(row)
        if len(self._rows) == ROWS_AT_ONCE:
            self._flush()

    def _flush(self) -> None:
        self._parquet.write_table(pa.Table.from_pylist(self._rows, schema=SCHEMA))
        self._rows = []

    def __enter__(self) -> RecordWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._stream is not None:
            self._stream.close()
            return
        if self._rows:
            self._flush()
        self._parquet.close()

# SPDX-License-Identifier: GPL-3.0-or-later
"""What a model said about images, from a table: any model, by any program."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from generator.dataset.format.files import one_line
from generator.dataset.format.parquet import iter_batches, open_parquet
from generator.errors import UsageError
from generator.escape import quoted
from generator.plan.poses import ANGLES
from generator.reading import check_regular

NAME, FILE = "sample_id", "input"
"""A row is named by its sample_id, or by the path of its image file, as `downstream-hpe predict` does."""

MAX_BYTES = 1 << 30
ROWS_AT_ONCE = 1 << 16


class Predictions:
    """Yaw, pitch and roll in degrees by sample_id; NaN where a model found no face."""

    def __init__(self, path: Path, angles: dict[str, tuple[float, float, float]]) -> None:
        self.path, self._angles = path, angles

    def of(self, sample_ids: Iterable[str]) -> np.ndarray:
        """float64 [N, 3]. Raises UsageError if one is not in the table."""
        names = list(sample_ids)
        if lost := [name for name in names if name not in self._angles]:
            raise UsageError(
                f"{self.path}: {len(lost)} of {len(names)} images are not in it, such as {lost[0]}; it has "
                "to have a line for every row and every twin, with empty angles where no face was found"
            )
        return np.array([self._angles[name] for name in names], np.float64).reshape(-1, 3)


def read_predictions(path: Path) -> Predictions:
    """Read a .csv or .parquet with sample_id (or input), yaw_deg, pitch_deg and roll_deg.

    Raises UsageError: it cannot be read, lacks a column, or names an image twice.
    """
    try:
        check_regular(path, MAX_BYTES)
        table = _read_parquet(path) if path.suffix.lower() == ".parquet" else pa_csv.read_csv(path)
        name = NAME if NAME in table.column_names else FILE
        columns = [name, *(f"{angle}_deg" for angle in ANGLES)]
        if lost := [column for column in columns if column not in table.column_names]:
            raise UsageError(
                f"{path}: no column {NAME if lost[0] == FILE else lost[0]}; expected {NAME}, yaw_deg, "
                "pitch_deg, roll_deg"
            )
        texts = table[name].cast(pa.string()).to_pylist()
        angles = [table[column].cast(pa.float64()).to_pylist() for column in columns[1:]]
    except (OSError, ValueError, pa.ArrowException) as error:
        raise UsageError(f"{path}: no table of predictions that can be read ({one_line(error)})") from error
    found: dict[str, tuple[float, float, float]] = {}
    for text, yaw, pitch, roll in zip(texts, *angles, strict=True):
        key = text or ""
        if name == FILE:
            *_, subject, expression, file = ("", "", *PurePosixPath(key.replace("\\", "/")).parts)
            key = f"{subject}/{expression}/{file.rpartition('.')[0]}"
        if key in found:
            raise UsageError(f"{path}: {quoted(key)} stands in it twice; give one line an image")
        found[key] = tuple(np.nan if a is None else float(a) for a in (yaw, pitch, roll))  # type: ignore[assignment]
    return Predictions(path, found)


def _read_parquet(path: Path) -> pa.Table:
    with open_parquet(path) as file:
        schema = file.schema_arrow
    return pa.Table.from_batches(iter_batches(path, ROWS_AT_ONCE), schema)

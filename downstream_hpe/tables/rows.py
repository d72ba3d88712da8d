# SPDX-License-Identifier: MIT
"""Rows of a table in memory: those with a face, and what becomes of those without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.partial import LEAST_POINTS, seen_points
from downstream_hpe.tables.columns import (
    ANGLE_COLUMNS,
    HEAD_COLUMNS,
    angles_of,
    check_columns,
    check_rows,
    column,
    landmarks_of,
    vectors,
)
from downstream_hpe.tables.missing import EXACT_COLUMNS, exact_in_pixels
from downstream_hpe.tables.open import open_tables

VISIBLE = "landmarks_visible"


@dataclass(frozen=True)
class Rows:
    """Rows with a face, in memory.

    heads      str [N], "subject/expression"; subjects str [N]: what a split must not divide
    ypr_deg    float64 [N, 3]; rotation float64 [N, 3, 3], R_C
    landmarks  float32 [N, 468, 3], isotropic pixels, frame C; NaN where a partial face has no point
    undetected number of rows left out because no face was found
    """

    heads: np.ndarray
    subjects: np.ndarray
    ypr_deg: np.ndarray
    rotation: np.ndarray
    landmarks: np.ndarray
    undetected: int

    def __len__(self) -> int:
        return len(self.ypr_deg)

    @property
    def complete(self) -> np.ndarray:
        """Which faces are not partial: bool [N]."""
        return np.asarray(seen_points(self.landmarks).all(axis=1))

    def take(self, chosen: np.ndarray) -> Rows:
        """The chosen rows. chosen: bool or int, as numpy indexes."""
        arrays = (self.heads, self.subjects, self.ypr_deg, self.rotation, self.landmarks)
        heads, subjects, ypr_deg, rotation, points = (array[chosen] for array in arrays)
        return Rows(heads, subjects, ypr_deg, rotation, points, 0)

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """The rows of several, one after the other."""
        names = ("heads", "subjects", "ypr_deg", "rotation", "landmarks")
        arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        heads, subjects, ypr_deg, rotation, points = arrays
        return Rows(heads, subjects, ypr_deg, rotation, points, sum(part.undetected for part in parts))


def read_rows(path: Path | str, split: str | None = None, partial: bool = False) -> Rows:
    """Every row with a face, in the order of the files.

    split: only the rows of this split; None: all of them. partial: with rows on which no face was found, as
    partial faces of the exact landmarks that the camera sees, if they are at least LEAST_POINTS.

    Raises
    ------
    DataError: as :func:`open_tables`; no such row; a row whose rotation is not that of its angles, or whose
        landmarks are not finite although it is marked detected; without exact landmarks where they are to be
        read.
    """
    columns = [*HEAD_COLUMNS, "split", *ANGLE_COLUMNS, "rotation", "detected", "landmarks"]
    tables = open_tables(path, columns)
    if partial:
        columns += [*EXACT_COLUMNS, VISIBLE]
        for file in tables.files:
            check_columns(file.path, file.physical_schema, columns, "leave out --partial")
    chosen = None if split is None else ds.field("split") == split
    found: list[tuple[np.ndarray, ...]] = []
    undetected = 0
    for batch in tables.batches(columns, chosen):
        check_rows(tables.path, batch)
        points, kept = landmarks_of(batch), column(batch, "detected")
        if partial:
            points = np.where(kept[:, None, None], points, _exact_visible(batch))
            kept = kept | (seen_points(points).sum(axis=1) >= LEAST_POINTS)
        undetected += int((~kept).sum())
        subjects = column(batch, "subject")
        heads = np.array([f"{s}/{e}" for s, e in zip(subjects, column(batch, "expression"), strict=True)])
        rotation = vectors(batch, "rotation", 9).reshape(-1, 3, 3)
        values = (heads, subjects, angles_of(batch), rotation, points)
        found.append(tuple(value[kept] for value in values))
    if not sum(len(values[0]) for values in found):
        of = f" of split {split!r}" if split else ""
        raise DataError(f"{tables.path}: no row{of} with a detected face; nothing to read")
    every = (np.concatenate(values) for values in zip(*found, strict=True))
    all_heads, all_subjects, ypr_deg, rotation, points = every
    return Rows(all_heads, all_subjects, ypr_deg, rotation, points, undetected)


def _exact_visible(batch: pa.RecordBatch) -> np.ndarray:
    """Exact landmarks, NaN where the camera does not see them: float32 [N, 468, 3], pixels, frame C."""
    visible = vectors(batch, VISIBLE, POINTS).astype(bool)
    points = exact_in_pixels(batch)
    there = visible & seen_points(points)
    return np.where(there[..., None], points, np.float32(np.nan))


def read_missed(path: Path | str, split: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The rows on which no face was found: their subjects, str [M], and angles, float64 [M, 3]."""
    columns = ["subject", "split", *ANGLE_COLUMNS, "detected"]
    where = ~ds.field("detected")
    if split is not None:
        where &= ds.field("split") == split
    batches = list(open_tables(path, columns).batches(columns, where))
    subjects = [str(name) for batch in batches for name in column(batch, "subject")]
    return np.array(subjects, dtype=np.str_), np.concatenate([np.empty((0, 3)), *map(angles_of, batches)])


def read_exact(path: Path | str, split: str | None = None) -> np.ndarray | None:
    """Exact landmarks of the rows of :func:`read_rows`: float32 [N, 468, 3], mm, frame C, NaN where a point
    has no anchor. None: the tables have none."""
    columns = ["split", "detected"]
    tables = open_tables(path, columns)
    if any("landmarks_exact" not in file.physical_schema.names for file in tables.files):
        return None
    for file in tables.files:
        check_columns(
            file.path, file.physical_schema, ["landmarks_exact"], "expected a table of headturn build"
        )
    where = ds.field("detected")
    if split is not None:
        where &= ds.field("split") == split
    batches = tables.batches([*columns, "landmarks_exact"], where)
    return np.concatenate([vectors(b, "landmarks_exact", FEATURES).reshape(-1, POINTS, 3) for b in batches])

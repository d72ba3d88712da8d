# SPDX-License-Identifier: MIT
"""Which cells of the pose grid a dataset has, from its small columns alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.tables.columns import (
    ANGLE_COLUMNS,
    HEAD_COLUMNS,
    INDEX_COLUMNS,
    angles_of,
    cell_name,
    column,
)
from downstream_hpe.tables.open import Tables, file_batches

Place = tuple[int, int, int]
Cells = dict[str, dict[Place, tuple[tuple[float, float, float], bool]]]


def index_cells(
    found: Tables, subjects: Collection[str] | None, expression: str | None
) -> tuple[Cells, dict[str, list[ds.ParquetFileFragment]], int]:
    """Angles and detection of each cell of each head, the files of each head, rows off the grid."""
    rows = None if expression is None else ds.field("expression") == expression
    if subjects is not None:
        chosen = ds.field("subject").isin(sorted(subjects))
        rows = chosen if rows is None else rows & chosen
    cells: Cells = defaultdict(dict)
    files: dict[str, list[ds.ParquetFileFragment]] = defaultdict(list)
    off_grid = 0
    columns = [*HEAD_COLUMNS, *INDEX_COLUMNS, *ANGLE_COLUMNS, "detected"]
    for file in found.files:
        for batch in file_batches(file, columns, rows):
            parts = [column(batch, name) for name in (*HEAD_COLUMNS, "detected")]
            for subject, expr, detected, place, angles in zip(
                *parts, places(batch).tolist(), angles_of(batch).tolist(), strict=True
            ):
                if min(place) < 0:
                    off_grid += 1
                    continue
                head = f"{subject}/{expr}"
                key = tuple(place)
                if key in cells[head]:
                    raise DataError(f"{found.path}: two rows for {cell_name(head, angles)}")
                cells[head][key] = (tuple(angles), bool(detected))
                if not files[head] or files[head][-1] is not file:
                    files[head].append(file)
    return cells, files, off_grid


def grid_axes(where: Path, cells: Cells) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The angle of each index, which must be the same for every head and rise with the index."""
    axes = []
    for k, name in enumerate(ANGLES):
        angles: dict[int, float] = {}
        for rows in cells.values():
            for place, (ypr, _) in rows.items():
                if angles.setdefault(place[k], ypr[k]) != ypr[k]:
                    raise DataError(
                        f"{where}: {name}_index {place[k]} is {angles[place[k]]:g}° in one row and "
                        f"{ypr[k]:g}° in another; read one grid at a time"
                    )
        if sorted(angles) != list(range(len(angles))):
            raise DataError(f"{where}: {name}_index has gaps ({sorted(angles)}); the grid is not complete")
        axis = np.array([angles[i] for i in range(len(angles))])
        if (np.diff(axis) <= 0).any():
            raise DataError(f"{where}: {name}_deg does not rise with {name}_index")
        axes.append(axis)
    return axes[0], axes[1], axes[2]


def places(batch: pa.RecordBatch) -> np.ndarray:
    """Index of yaw, pitch and roll on the grid, int16 [N, 3]; -1 off the grid."""
    return np.stack([column(batch, name) for name in INDEX_COLUMNS], axis=-1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of rows, from the rows themselves: every row may have its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.open import as_array
from generator.geometry.camera import isotropic_pixels

COLUMNS = ("camera", "translation_mm", "projection", "width", "height")
"""What :meth:`RowCameras.of` reads."""


@dataclass(frozen=True, eq=False)
class RowCameras:
    """N cameras.

    matrix: float64 [N, 3, 3], K. translation_mm: float64 [N, 3], the pivot in frame C.
    projection: [N] names. width, height: int [N], of the images in pixels.
    """

    matrix: np.ndarray
    translation_mm: np.ndarray
    projection: np.ndarray
    width: np.ndarray
    height: np.ndarray

    @classmethod
    def of(cls, table: pa.Table | pa.RecordBatch) -> RowCameras:
        """Those of a table's rows; it has the columns :data:`COLUMNS`."""
        return cls(
            as_array(table, "camera").reshape(-1, 3, 3),
            as_array(table, "translation_mm"),
            np.array(table.column("projection").to_pylist(), dtype=object),
            as_array(table, "width"),
            as_array(table, "height"),
        )

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> RowCameras:
        """That of one row as plain values."""
        return cls(
            np.array(row["camera"], dtype=np.float64).reshape(1, 3, 3),
            np.array([row["translation_mm"]], dtype=np.float64),
            np.array([row["projection"]], dtype=object),
            np.array([row["width"]]),
            np.array([row["height"]]),
        )

    def __len__(self) -> int:
        return len(self.matrix)

    def __getitem__(self, rows: np.ndarray | slice) -> RowCameras:
        """Some of them: places, flags or a slice."""
        return RowCameras(
            self.matrix[rows],
            self.translation_mm[rows],
            self.projection[rows],
            self.width[rows],
            self.height[rows],
        )

    def pixels(self, points_mm: np.ndarray) -> np.ndarray:
        """Where each row's camera sees its points: float [N, P, 3], frame C, mm -> float64 [N, P, 3],
        isotropic pixels, see :func:`generator.geometry.camera.isotropic_pixels`."""
        return isotropic_pixels(points_mm, self.matrix, self.translation_mm, self.projection.tolist())

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """Are places (x, y, ...) in the row's image? float [N, P, >= 2] -> bool [N, P]."""
        size = np.stack([self.width, self.height], axis=-1)[:, None]
        return ((pixels[..., :2] >= 0) & (pixels[..., :2] <= size)).all(axis=-1)

# SPDX-License-Identifier: MIT
"""What becomes of cells on which no face was found: an explicit choice, and a report of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pyarrow as pa

from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.tables.columns import column, vectors

Missing = Literal["fail", "keep", "exact", "frontal"]
"""fail: refuse them. keep: they stay without landmarks, and the fit leaves them out. exact: filled with
the landmarks anchored on the surface. frontal: filled with the head's detection nearest to the front,
turned, as the paper does. The generator's word for leaving rows out, skip, means nothing here: a grid
without a cell is a grid whose cell is missing."""

MISSING: tuple[Missing, ...] = get_args(Missing)

EXACT_COLUMNS = ("landmarks_exact", "camera", "translation_mm", "projection")
"""What :func:`exact_in_pixels` reads."""


@dataclass(frozen=True)
class MissingReport:
    """Which cells had no landmarks, and what became of them.

    cells: names, "subject/expression at yaw .., pitch .., roll ..". absent: how many of them have
    no row at all; the others have a row without a detected face. off_grid: rows left out because
    they are no cell of the grid.
    """

    cells: tuple[str, ...]
    absent: int
    off_grid: int
    choice: Missing

    def text(self, names: int = 5) -> str:
        """One line; at most so many cells by name."""
        done = {
            "fail": "",
            "keep": " left out of the fit",
            "exact": " filled from exact landmarks",
            "frontal": " filled with the head's detection nearest to the front, turned",
        }[self.choice]
        if not self.cells:
            return "every cell has landmarks"
        more = f" and {len(self.cells) - names} more" if len(self.cells) > names else ""
        return (
            f"{len(self.cells)} cells without landmarks{done} ({self.absent} of them without a row): "
            + "; ".join(self.cells[:names])
            + more
        )


def exact_in_pixels(batch: pa.RecordBatch) -> np.ndarray:
    """Exact landmarks as the detector would give them: float32 [N, 468, 3], isotropic pixels, frame C.

    x, y: projected by K; orthographic rows are divided by t_z, the pivot's depth, instead of their own.
    z: (Z - t_z) f / t_z, so that a unit is worth as much as in x and y at the pivot. The generator's
    fill_missing does the same. NaN where a point has no anchor.
    """
    points = vectors(batch, "landmarks_exact", FEATURES).reshape(-1, POINTS, 3).astype(np.float64)
    camera = vectors(batch, "camera", 9).reshape(-1, 3, 3)
    pivot = vectors(batch, "translation_mm", 3)[:, 2, None]
    orthographic = (column(batch, "projection") == "orthographic")[:, None]
    depth = np.where(orthographic, pivot, points[..., 2])[..., None]
    rays = np.concatenate([points[..., :2] / depth, np.ones_like(depth)], axis=-1)
    pixels = rays @ np.swapaxes(camera, -1, -2)
    pixels[..., 2] = (points[..., 2] - pivot) * (camera[:, 0, 0, None] / pivot)
    return pixels.astype(np.float32)


def turned_frontal(faces: np.ndarray, empty: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """One head's missing cells: its detection nearest to the front, turned to the pose of each.

    faces: float [D..., 468, 3], about the point they turn on, as normalised faces are. empty: bool [D...],
    cells without a face, but not all of them. rotation: R_C, float64 [D..., 3, 3].

    Returns
    -------
    float64 [M, 468, 3], in the order of empty's cells.
    """
    seen = np.argwhere(~empty)
    ahead = np.trace(rotation[~empty], axis1=1, axis2=2)
    front = tuple(seen[np.argmax(ahead)])
    level = faces[front] @ rotation[front]  # rows x^T R = (R^T x)^T
    return level @ np.swapaxes(rotation[empty], -1, -2)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The box around the face in an image, as far as a row knows it."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from generator.dataset.format.open import as_array
from generator.dataset.format.row_cameras import RowCameras

BOX_ABOUT = """\
The box of a face is that of all its landmarks in the image, forehead to chin: of the mesh's where the head
has at least half of them, else of the detected ones. Where there are neither, nobody knows it."""
"""For the README.md of a format with boxes."""


def face_boxes(batch: pa.RecordBatch, cameras: RowCameras) -> list[np.ndarray | None]:
    """x1, y1, x2, y2 of each row in pixels, float64 [4]; None where no landmark is known.

    A box may reach beyond the image, as the face does.
    """
    exact_mm = as_array(batch, "landmarks_exact")
    anchored = np.isfinite(exact_mm).all(axis=2).mean(axis=1) >= 0.5
    exact, detected = cameras.pixels(exact_mm), as_array(batch, "landmarks").astype(np.float64)
    points = np.where(anchored[:, None, None], exact, detected)[..., :2]
    known = anchored | as_array(batch, "detected").astype(bool)
    return [_box(row) if ok else None for row, ok in zip(points, known, strict=True)]


def _box(points: np.ndarray) -> np.ndarray:
    return np.concatenate([np.nanmin(points, axis=0), np.nanmax(points, axis=0)])

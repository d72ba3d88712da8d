# SPDX-License-Identifier: GPL-3.0-or-later
"""What a consumer can do where the detector found no face: an explicit choice, and a mark on every row."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import pyarrow as pa

from generator.dataset.format.open import as_array
from generator.errors import UsageError
from generator.geometry.camera import project_with

Choice = Literal["masked", "exact", "frontal"]
CHOICES: tuple[Choice, ...] = get_args(Choice)


def fill_missing(table: pa.Table, choice: Choice) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks of every row, and where each row's come from.

    ``masked``   missing rows stay NaN.
    ``exact``    the exact landmarks in the detector's units: projected to pixels, depth from the
                 pivot scaled like x and y at the pivot. Right about the pose, but not what the
                 detector would have said: its errors are missing.
    ``frontal``  the paper's: the detection of the same head nearest to the front, turned to the
                 row's pose. It carries the detector's idea of the face to poses it cannot see.

    Parameters
    ----------
    table: rows of a dataset, all columns (or those used below).

    Returns
    -------
    (float32 [N, 468, 3] in isotropic pixels, frame C; text [N] "detected", "exact", "frontal" or
    "missing"). "missing" are NaN: always with "masked"; with "frontal" where a head was detected
    nowhere; with "exact" where it has no anchors. Single points without an anchor are NaN in
    "exact" rows.

    Raises UsageError for an unknown choice.
    """
    if choice not in CHOICES:
        raise UsageError(f"missing detections: {choice!r} is none of {', '.join(CHOICES)}")
    landmarks = as_array(table, "landmarks").copy()
    detected = as_array(table, "detected").astype(bool)
    origin = np.where(detected, "detected", "missing")
    if choice == "masked":
        return landmarks, origin
    filled = exact_in_pixels(table) if choice == "exact" else rotated_frontal(table)
    use = ~detected & np.isfinite(filled).all(axis=2).any(axis=1)
    landmarks[use], origin[use] = filled[use], choice
    return landmarks, origin


def exact_in_pixels(table: pa.Table) -> np.ndarray:
    """Exact landmarks as the detector would give them, float32 [N, 468, 3], isotropic pixels, frame C.

    x, y: projected. z: (Z - t_z) f / t_z, so that a unit is worth as much as in x and y.
    """
    exact = as_array(table, "landmarks_exact").astype(np.float64)
    matrix = as_array(table, "camera").reshape(-1, 3, 3)
    distance = as_array(table, "translation_mm")[:, 2]
    orthographic = np.array(table.column("projection").to_pylist()) == "orthographic"
    pixels = project_with(matrix, exact, np.where(orthographic, distance, np.nan))
    z = (exact[..., 2] - distance[:, None]) * (matrix[:, 0, 0] / distance)[:, None]
    return np.concatenate([pixels, z[..., None]], axis=2).astype(np.float32)


def rotated_frontal(table: pa.Table) -> np.ndarray:
    """Each head's detection nearest to the front, turned about its centroid to each row's pose.

    float32 [N, 468, 3]; NaN for heads that were detected nowhere.
    """
    landmarks = as_array(table, "landmarks").astype(np.float64)
    detected = as_array(table, "detected").astype(bool)
    rotation = as_array(table, "rotation").reshape(-1, 3, 3)
    away = -np.trace(rotation, axis1=1, axis2=2)
    names = zip(*(table.column(n).to_pylist() for n in ("subject", "expression")), strict=True)
    rows_of: dict[tuple[str, str], list[int]] = {}
    for row, name in enumerate(names):
        rows_of.setdefault(name, []).append(row)
    turned = np.full(landmarks.shape, np.nan)
    for rows in rows_of.values():
        seen = [row for row in rows if detected[row]]
        if not seen:
            continue
        front = min(seen, key=away.__getitem__)
        centroid = landmarks[front].mean(axis=0)
        at_zero = (landmarks[front] - centroid) @ rotation[front]  # row vectors: this is R^T x
        turned[rows] = at_zero @ np.swapaxes(rotation[rows], 1, 2) + centroid
    return turned.astype(np.float32)

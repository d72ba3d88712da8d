# SPDX-License-Identifier: GPL-3.0-or-later
"""What a consumer can do where the detector found no face: an explicit choice, and a mark on every row."""

from __future__ import annotations

from typing import Literal, cast

import numpy as np
import pyarrow as pa

from generator.dataset.format.defaults import todays_schema, with_defaults
from generator.dataset.format.open import as_array
from generator.errors import UsageError
from generator.geometry.camera import isotropic_pixels

Missing = Literal["fail", "keep", "skip", "exact", "frontal"]

MISSING: dict[Missing, str] = {
    "fail": "refuse, and name a row",
    "keep": "keep the row as it is, without landmarks",
    "skip": "leave the row out",
    "exact": "fill in the exact landmarks, each row marked as such",
    "frontal": "fill in the head's own frontal detection, turned to the pose, each row marked as such",
}
"""What can be done about rows without a detection, by the one name it has everywhere."""

CHOICES: tuple[Missing, ...] = ("keep", "exact", "frontal")
"""Those of :func:`fill_missing`."""

ALIASES: dict[str, Missing] = {"masked": "keep"}
"""Earlier names."""


def fill_missing(table: pa.Table, choice: str) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks of every row, and where each row's come from.

    ``keep``     missing rows stay NaN.
    ``exact``    the exact landmarks in the detector's units: projected to pixels, depth from the
                 pivot scaled like x and y at the pivot. Right about the pose, but not what the
                 detector would have said: its errors are missing.
    ``frontal``  the paper's: the detection of the same head nearest to the front, turned to the
                 row's pose. It carries the detector's idea of the face to poses it cannot see.

    Parameters
    ----------
    table: rows of a dataset of any 1.x, all columns (or those used below).

    Returns
    -------
    (float32 [N, P, 3] in isotropic pixels, frame C; text [N] "detected", "exact", "frontal" or
    "missing"). "missing" are NaN: always with "keep"; with "frontal" where a head was detected
    nowhere; with "exact" where it has no anchors. Single points without an anchor are NaN in
    "exact" rows.

    Raises UsageError for an unknown choice.
    """
    choice = ALIASES.get(choice, cast(Missing, choice))
    if choice not in CHOICES:
        raise UsageError(f"missing detections: {choice!r} is none of {', '.join(CHOICES)}")
    table = with_defaults(table, todays_schema(table.schema))
    landmarks = as_array(table, "landmarks").copy()
    detected = as_array(table, "detected").astype(bool)
    origin = np.where(detected, "detected", "missing")
    if choice == "keep":
        return landmarks, origin
    filled = exact_in_pixels(table) if choice == "exact" else rotated_frontal(table)
    use = ~detected & np.isfinite(filled).all(axis=2).any(axis=1)
    landmarks[use], origin[use] = filled[use], choice
    return landmarks, origin


def exact_in_pixels(table: pa.Table) -> np.ndarray:
    """Exact landmarks as the detector would give them, float32 [N, P, 3], isotropic pixels, frame C."""
    exact, matrix, shift = (as_array(table, name) for name in ("landmarks_exact", "camera", "translation_mm"))
    return isotropic_pixels(exact, matrix, shift, table.column("projection").to_pylist()).astype(np.float32)


def rotated_frontal(table: pa.Table) -> np.ndarray:
    """Each head's detection nearest to the front, turned about its centroid to each row's pose.

    float32 [N, P, 3]; NaN for heads that were detected nowhere.
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

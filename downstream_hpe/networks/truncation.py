# SPDX-License-Identifier: MIT
"""Faces that a dataset must not teach, because it ends there and another goes on.

A detector reads a head that is turned far as turned less. In a dataset that ends at 45 degrees, whoever
reads as 45 is turned by 45 at most; in the world, by more. So where one dataset reaches much further than
another, faces that read as near the other's end are learned from the further one alone. They are chosen by
how they read, which is all that a model sees, and not by how they are turned, which would shift a mean, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation
from downstream_hpe.tables.rows import Rows

FURTHER_DEG = 30.0
"""A dataset that reaches so much further goes on where another ends."""
NEAR_DEG = 12.0
"""From the end: about what a detector is off by there."""


def untruncated(datasets: Sequence[Rows], face: np.ndarray) -> list[Rows]:
    """Datasets without the complete faces that read as near an end which is theirs and not everybody's.

    face: float [468, 3], frame C; its rigid fit says how a face reads.
    """
    ends = np.array([[rows.ypr_deg.min(axis=0), rows.ypr_deg.max(axis=0)] for rows in datasets])
    low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
    kept = []
    for rows, (first, last) in zip(datasets, ends, strict=True):
        first = np.where(low < first - FURTHER_DEG, first + NEAR_DEG, -np.inf)
        last = np.where(high > last + FURTHER_DEG, last - NEAR_DEG, np.inf)
        read = angles_from_rotation(fit_rotation(face, rows.landmarks.astype(np.float64)))
        kept.append(rows.take(((read > first) & (read < last)).all(axis=1) | ~rows.complete))
    return kept

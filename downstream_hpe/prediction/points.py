# SPDX-License-Identifier: MIT
"""Which points of given faces are seen, and whether they are enough."""

from __future__ import annotations

import numpy as np

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.partial import LEAST_POINTS, seen_points


def points_seen(landmarks: np.ndarray, whole_for: str | None) -> np.ndarray:
    """Which points there are: float [N, 468, 3] -> bool [N, 468].

    whole_for: the name of a model that takes complete faces alone; None: of one that takes partial ones.

    Raises
    ------
    DataError: infinite landmarks, or fewer than LEAST_POINTS of a face. ModelError: a partial face for a
        model of complete ones.
    """
    seen = np.asarray(seen_points(landmarks))
    if np.isinf(landmarks).any() or not seen.any(axis=1).all():
        raise DataError("landmarks are not finite; leave out faces that were not detected")
    count = int(seen.sum(axis=1).min(initial=POINTS))
    if count < LEAST_POINTS:
        raise DataError(f"{count} landmarks of a face, expected at least {LEAST_POINTS}; leave it out")
    if count < POINTS and whole_for is not None:
        raise ModelError(
            f"{whole_for}: takes complete faces, and points are missing (NaN); models of "
            "downstream-hpe fit --recipe continuous take partial ones"
        )
    return seen

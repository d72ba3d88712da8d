# SPDX-License-Identifier: MIT
"""Faces of which some points are not seen, as in profile: those are NaN, and a mean face stands in for them.

A partial face that is centred and scaled by the points it has lies elsewhere than the whole one does. So it
is moved to where the mean face has the same points; what is left between the two is then of shape alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from downstream_hpe.geometry.rotation import fit_rotation

LEAST_POINTS = 20
"""Fewer tell no pose."""


def seen_points(landmarks: np.ndarray) -> Any:
    """Which points there are: float [..., P, 3] -> bool [..., P]. A point without one coordinate is none."""
    return ~np.isnan(landmarks).any(axis=-1)


def among(mean: Any, seen: Any) -> tuple[Any, Any]:
    """Where a mean face [P, 3] has its seen points: their centre [N, 3], and their RMS distance to it [N, 1],
    relative to the centre and RMS distance of all its points.

    seen: [N, P], 1 for what is seen, 0 for what is not. Arrays of numpy or tensors of torch.
    """
    centred = mean - mean.mean(0)
    squares = (centred * centred).sum(1)
    count = seen.sum(1)[:, None]
    centre = seen @ centred / count
    spread = seen @ squares[:, None] / count - (centre * centre).sum(1)[:, None]
    return centre, (spread / squares.mean()) ** 0.5


def completed(landmarks: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Faces float [N, P, 3] whose points that are not seen lie where a mean face [P, 3] has them, which is
    fitted to the others by rotation, scale and place."""
    seen = seen_points(landmarks)
    centre, spread = among(mean, seen.astype(np.float64))
    rotation = fit_rotation(mean, landmarks)
    middle = np.nanmean(landmarks, axis=1, keepdims=True)
    whole = np.square(mean - mean.mean(0)).sum(1).mean()
    size = np.sqrt(np.nanmean(np.square(landmarks - middle).sum(axis=-1), axis=1) / whole)
    level = (mean - mean.mean(0) - centre[:, None]) * (size[:, None] / spread)[..., None]
    stand_in = level @ np.swapaxes(rotation, -1, -2) + middle
    return np.where(seen[..., None], landmarks, stand_in)

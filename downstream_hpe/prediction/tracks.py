# SPDX-License-Identifier: MIT
"""Which face of the frame before a face is, and a filter for each."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from downstream_hpe.prediction.smoothing import OneEuroFilter

MEMORY_S = 1.0
"""So long a face that is not seen keeps its index."""


class FaceTracks:
    """Indices that stay with the faces of a video, and a filter a face."""

    def __init__(self, smooth: bool) -> None:
        self._smooth = smooth
        self._seen: dict[int, tuple[np.ndarray, float]] = {}
        self._filters: dict[int, OneEuroFilter] = {}
        self._next = 0

    def indices(self, landmarks: np.ndarray, time_s: float) -> list[int]:
        """The index of each face: that of the nearest centre before, a new one where none is near.

        landmarks: float [F, 468, 3], pixels. Near is less than the face's own size.
        """
        xy = landmarks[..., :2]
        centres = (xy.min(axis=1) + xy.max(axis=1)) / 2
        sizes = np.ptp(xy, axis=1).max(axis=1)
        self._seen = {k: (at, last) for k, (at, last) in self._seen.items() if time_s - last <= MEMORY_S}
        names = list(self._seen)
        found = [-1] * len(centres)
        if names and len(centres):
            before = np.stack([at for at, _ in self._seen.values()])
            distances = np.linalg.norm(centres[:, None] - before, axis=-1) / sizes[:, None]
            for face, name in zip(*linear_sum_assignment(np.minimum(distances, 1.0)), strict=True):
                if distances[face, name] < 1:
                    found[face] = names[name]
        for face, index in enumerate(found):
            if index < 0:
                found[face] = self._next
                self._next += 1
            self._seen[found[face]] = (centres[face], time_s)
        # Whoever is not in this frame is filtered afresh when back.
        self._filters = {k: f for k, f in self._filters.items() if k in found}
        return found

    def steady(self, index: int, rotation: np.ndarray, time_s: float) -> np.ndarray:
        """The rotation [3, 3] of a face, smoothed by its own filter where that was asked for."""
        if not self._smooth:
            return rotation
        return self._filters.setdefault(index, OneEuroFilter())(rotation, time_s)

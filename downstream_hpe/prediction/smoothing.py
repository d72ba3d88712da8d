# SPDX-License-Identifier: MIT
"""Less jitter in video without lag in fast turns: the one-euro filter on rotations."""

from __future__ import annotations

import numpy as np

from downstream_hpe.geometry.metrics import geodesic_errors

MIN_CUTOFF = 1.0
"""Hz at rest."""
BETA = 0.05
"""Hz a degree/s."""
SPEED_CUTOFF = 1.0
"""Hz, of the speed's own filter."""


class OneEuroFilter:
    """Casiez, Roussel and Vogel, "1 Euro Filter", CHI 2012, with the angular speed as the speed.

    cutoff = min_cutoff + beta |speed|,  a = 1 / (1 + 1 / (2 pi cutoff dt)),
    R <- nearest rotation to a R_new + (1 - a) R

    min_cutoff, beta, speed_cutoff: see the constants.
    """

    def __init__(
        self, min_cutoff: float = MIN_CUTOFF, beta: float = BETA, speed_cutoff: float = SPEED_CUTOFF
    ) -> None:
        self._min_cutoff, self._beta, self._speed_cutoff = min_cutoff, beta, speed_cutoff
        self._state: tuple[np.ndarray, np.ndarray, float, float] | None = None

    def __call__(self, rotation: np.ndarray, time_s: float) -> np.ndarray:
        """The filtered rotation [3, 3]. Times must rise; the first one passes unchanged."""
        if self._state is None:
            self._state = (rotation, rotation, time_s, 0.0)
            return rotation
        smooth, raw, before, speed = self._state
        step = time_s - before
        if step <= 0:
            raise ValueError(f"times must rise: {time_s} s after {before} s")
        now = float(geodesic_errors(raw, rotation)) / step
        speed += _share(self._speed_cutoff, step) * (now - speed)
        share = _share(self._min_cutoff + self._beta * speed, step)
        u, _, vt = np.linalg.svd(share * rotation + (1 - share) * smooth)
        smooth = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        self._state = (smooth, rotation, time_s, speed)
        return smooth


def _share(cutoff: float, step_s: float) -> float:
    return 1.0 / (1.0 + 1.0 / (2 * np.pi * cutoff * step_s))

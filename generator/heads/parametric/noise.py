# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth random fields."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

_PERIOD = 32


def smooth_noise(rng: np.random.Generator, coordinates: tuple[np.ndarray, ...]) -> np.ndarray:
    """Value noise, one lattice cell a unit, about -1 to 1, in the shape of the coordinates.

    coordinates: one array an axis (2 or 3 of them).
    """
    lattice = rng.uniform(-1, 1, (_PERIOD,) * len(coordinates)).astype(np.float32)
    return map_coordinates(lattice, coordinates, order=1, mode="grid-wrap")


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below low, 1 above high, cubic between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)

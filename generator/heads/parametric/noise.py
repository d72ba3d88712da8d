# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth random fields."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.sparse import csr_matrix

_PERIOD = 32

_GRAIN_LENGTH = 2**21


def smooth_noise(rng: np.random.Generator, coordinates: tuple[np.ndarray, ...]) -> np.ndarray:
    """Value noise, one lattice cell a unit, about -1 to 1, in the shape of the coordinates.

    coordinates: one array an axis (2 or 3 of them).
    """
    return map_coordinates(_lattice(rng, len(coordinates)), coordinates, order=1, mode="grid-wrap")


class NoiseField:
    """:func:`smooth_noise` at places that stay: how each hangs on the lattice is worked out once.

    coordinates: one array [N] an axis.
    """

    def __init__(self, *coordinates: np.ndarray) -> None:
        self._axes = len(coordinates)
        lows, shares = [], []
        for values in coordinates:
            low = np.floor(values)
            lows.append(low.astype(np.int32))
            shares.append((values - low).astype(np.float32))
        columns, weights = [], []
        for corner in product((0, 1), repeat=self._axes):
            column = np.zeros(len(lows[0]), dtype=np.int32)
            weight = np.ones(len(lows[0]), dtype=np.float32)
            for low, share, side in zip(lows, shares, corner, strict=True):
                column = column * _PERIOD + (low + side) % _PERIOD
                weight *= share if side else 1 - share
            columns.append(column)
            weights.append(weight)
        starts = np.arange(len(lows[0]) + 1, dtype=np.int32) * len(columns)
        flat = np.stack(weights, axis=1).ravel(), np.stack(columns, axis=1).ravel(), starts
        self._weights = csr_matrix(flat, shape=(len(lows[0]), _PERIOD**self._axes))

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """The noise of one lattice, float32 [N]."""
        values: np.ndarray = self._weights @ _lattice(rng, self._axes).ravel()
        return values


def grain(rng: np.random.Generator, count: int) -> np.ndarray:
    """Standard normal values, float32 [count], to be read only: a random piece of a long row of them."""
    row = _grain_row()
    start = int(rng.integers(len(row) - count))
    return row[start : start + count]


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below low, 1 above high, cubic between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _lattice(rng: np.random.Generator, axes: int) -> np.ndarray:
    return rng.uniform(-1, 1, (_PERIOD,) * axes).astype(np.float32)


@lru_cache(maxsize=1)
def _grain_row() -> np.ndarray:
    row = np.random.default_rng(0).standard_normal(_GRAIN_LENGTH, dtype=np.float32)
    row.flags.writeable = False
    return row

# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair under something on the head: flat above its rim, free below."""

from __future__ import annotations

import numpy as np

from generator.worn.fit import Fit
from generator.worn.skull import Skull

FLAT_MM = 3.0
"""How far from the head hair under a hat is at most."""

HIDDEN_MM = 18.0
"""Hair that is all so far above the rim is not made."""


class Rim:
    """The rim of what is on a head: a plane from the forehead to above the nape."""

    def __init__(self, fit: Fit, skull: Skull) -> None:
        top = fit.at(10)[0]
        self._skull = skull
        self._front = top[1] - 6 * skull.scale
        self._back = skull.ears.top - 4 * skull.scale
        self._ahead, self._behind = top[2], skull.centre[2] - 90 * skull.scale

    def above(self, points: np.ndarray) -> np.ndarray:
        """How far points [..., 3] are above it, mm."""
        share = (points[..., 2] - self._behind) / (self._ahead - self._behind)
        return points[..., 1] - (self._back + share * (self._front - self._back))

    def flattened(self, paths: np.ndarray, layer: np.ndarray) -> np.ndarray:
        """Paths [N, K, 3] that fit under it. layer: [N], 0 for hair next to the skin to 1."""
        skull, flat = self._skull, paths.reshape(-1, 3)
        away = flat - skull.centre
        distance = np.linalg.norm(away, axis=1)
        room = FLAT_MM + np.maximum(-self.above(flat) - 2 * skull.scale, 0)
        most = skull.radius(flat) + room * np.repeat(0.35 + 0.65 * layer, paths.shape[1])
        pressed = np.minimum(distance, most) / distance
        return (skull.centre + away * pressed[:, None]).reshape(paths.shape)

    def hides(self, paths: np.ndarray) -> np.ndarray:
        """Which paths [N, K, 3] nobody sees: bool [N]."""
        return (self.above(paths) > HIDDEN_MM * self._skull.scale).all(axis=1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair under something on the head: flat above its rim, free below."""

from __future__ import annotations

import numpy as np

from generator.plan.wear import NOTHING
from generator.worn.crown import DEPTH_MM, RIMS, rim_heights
from generator.worn.face import Face
from generator.worn.fit import Fit
from generator.worn.skull import Skull

FLAT_MM = 3.0
"""How far from the head hair under a hat is at most."""

HIDDEN_MM = 18.0
"""Hair that is all so far above the rim is not made."""

BAND, BAND_MM = "headband", 40.0
"""A style above which hair is seen again, and by how much above its rim."""


class Rim:
    """The rim of what is on a head, where its style has it."""

    def __init__(self, fit: Fit, skull: Skull) -> None:
        self._skull, self._face = skull, Face.of(fit)
        style = fit.others.get("headwear", NOTHING)
        self._style = style if style in RIMS else "cap"

    def above(self, points: np.ndarray) -> np.ndarray:
        """How far points [..., 3] are above it, mm."""
        there = points @ self._face.rotation
        turns = np.arctan2(there[..., 0], there[..., 2] - DEPTH_MM)
        return there[..., 1] - rim_heights(self._face, self._style, turns, (0.0, 0.0, 0.0))

    def flattened(self, paths: np.ndarray, layer: np.ndarray) -> np.ndarray:
        """Paths [N, K, 3] that fit under it. layer: [N], 0 for hair next to the skin to 1."""
        skull, flat = self._skull, paths.reshape(-1, 3)
        away = flat - skull.centre
        distance = np.linalg.norm(away, axis=1)
        above = self.above(flat)
        room = FLAT_MM + np.maximum(-above - 2 * skull.scale, 0)
        if self._style == BAND:
            room += np.maximum(above - BAND_MM * skull.scale, 0)
        most = skull.radius(flat) + room * np.repeat(0.35 + 0.65 * layer, paths.shape[1])
        pressed = np.minimum(distance, most) / distance
        return (skull.centre + away * pressed[:, None]).reshape(paths.shape)

    def hides(self, paths: np.ndarray) -> np.ndarray:
        """Which paths [N, K, 3] nobody sees: bool [N]."""
        if self._style == BAND:
            return np.zeros(len(paths), dtype=bool)
        return (self.above(paths) > HIDDEN_MM * self._skull.scale).all(axis=1)

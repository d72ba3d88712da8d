# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles of glasses: the outline of a lens and what holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.worn.shapes import curve

POINTS = 44
"""Of an outline."""


@dataclass(frozen=True)
class Frame:
    """A style. outline: points of a lens about its middle, x away from the nose, y up, within 1.

    width_mm: of a lens for eyes 63 mm apart, or 0 where the bridge decides. ratio: height over width.
    rim_mm: of the rim, seen from the front, below and above. depth_mm: of the rim. metal: or acetate.
    hinge: height of the temples, in half heights of the lens. double: has it a second bridge above?
    brow: is its upper half of acetate?
    """

    outline: tuple[tuple[float, float], ...]
    ratio: float
    rim_mm: tuple[float, float]
    depth_mm: float
    metal: bool
    widen_mm: float = 0.0
    hinge: float = 0.45
    double: bool = False
    brow: bool = False

    def points(self, width: float) -> np.ndarray:
        """The outline in mm, float64 [POINTS, 2], counter-clockwise."""
        return curve(self.outline, POINTS, closed=True) * [width / 2, self.ratio * width / 2]


def _rounded(power: float, narrow: float = 0.0, count: int = 24) -> tuple[tuple[float, float], ...]:
    """A superellipse, its lower half narrower by a share."""
    turn = np.arange(count) * 2 * np.pi / count
    cosine, sine = np.cos(turn), np.sin(turn)
    x = np.sign(cosine) * np.abs(cosine) ** (2 / power)
    y = np.sign(sine) * np.abs(sine) ** (2 / power)
    return tuple(zip((x * (1 - narrow * (1 - y) / 2)).tolist(), y.tolist(), strict=True))


_TEARDROP = (
    (1.0, 0.25), (0.93, 0.75), (0.6, 0.97), (0.0, 1.0), (-0.6, 0.95), (-0.93, 0.68), (-0.98, 0.2),
    (-0.82, -0.3), (-0.45, -0.78), (0.05, -1.0), (0.55, -0.86), (0.88, -0.4),
)  # fmt: skip
_CAT = (
    (0.97, 0.45), (1.06, 1.0), (0.82, 1.02), (0.3, 0.86), (-0.35, 0.76), (-0.86, 0.66), (-1.0, 0.2),
    (-0.86, -0.42), (-0.4, -0.93), (0.1, -1.0), (0.58, -0.83), (0.88, -0.3),
)  # fmt: skip

FRAMES: dict[str, Frame] = {
    "round": Frame(_rounded(2.1), 0.96, (1.3, 1.3), 1.9, metal=True, widen_mm=-1.0),
    "square": Frame(_rounded(4.4, 0.1), 0.80, (3.2, 4.4), 3.6, metal=False, widen_mm=2.0),
    "aviator": Frame(_TEARDROP, 0.86, (1.2, 1.2), 1.7, metal=True, widen_mm=5.0, hinge=0.62, double=True),
    "browline": Frame(_rounded(3.0, 0.12), 0.82, (1.2, 5.6), 3.2, metal=True, widen_mm=1.0, brow=True),
    "rimless": Frame(_rounded(3.4, 0.06), 0.68, (0.0, 0.0), 1.5, metal=True, widen_mm=2.0, hinge=0.35),
    "cat-eye": Frame(_CAT, 0.80, (2.6, 4.2), 3.4, metal=False, widen_mm=2.0, hinge=0.72),
}

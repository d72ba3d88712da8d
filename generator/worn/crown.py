# SPDX-License-Identifier: GPL-3.0-or-later
"""The upper head from a rim upwards, as what a hat has to enclose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.worn.face import FAR_MM, Face
from generator.worn.fit import CannotWear
from generator.worn.wrap import Taut, angles, directions, reach

RIMS: dict[str, tuple[float, float, float]] = {
    "cap": (0.62, 9.0, -24.0),
    "beanie": (0.65, -12.0, -28.0),
    "brimmed": (0.85, 9.0, -10.0),
    "headband": (0.70, 1.0, -21.0),
    "hard-hat": (0.80, 18.0, 2.0),
}
"""Style -> where its rim is: in front, as :func:`forehead` counts; at the sides and behind, in mm above the
tops of the ears."""

DEPTH_MM = 5.0
"""Of the axis that rims are about, before the pivot."""

BROWS, HAIRLINE = (105, 334), 10
"""Landmarks."""


@dataclass(frozen=True, eq=False)
class Crown:
    """centre: float64 [3], within the skull, F. turns: float64 [N], angles about y from the front on.
    rim: float64 [N], lift of the rim at each. taut: the hull of what is above the rim. over: mm that hair
    lifts it.
    """

    centre: np.ndarray
    turns: np.ndarray
    rim: np.ndarray
    taut: Taut
    over: float = 0.0

    def lifts(self, rows: np.ndarray) -> np.ndarray:
        """Lift angles [M, N] of rows between 0, the rim, and 1, the top."""
        return self.rim + rows[:, None] * (np.pi / 2 - self.rim)

    def distances(self, rows: np.ndarray) -> np.ndarray:
        """How far the head and its hair reach at rows [M], float64 [M, N]."""
        return self.taut.reach(self.towards(rows)) + self.over

    def towards(self, rows: np.ndarray) -> np.ndarray:
        """The directions of rows, float64 [M, N, 3]."""
        return directions(self.turns, self.lifts(rows))

    def at(self, rows: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """Points [M, N, 3] at distances [M, N]."""
        return self.centre + distances[..., None] * self.towards(rows)


def forehead(face: Face, share: float) -> float:
    """A height on the forehead: 0 at the brows, 1 where the landmarks end below the hair."""
    brows = face.at(*BROWS)[:, 1].mean()
    return float(brows + share * (face.at(HAIRLINE)[0, 1] - brows))


def ear_top(face: Face) -> float:
    """Height of the higher ear's top."""
    return max(side.ear.top for side in face.sides.values())


def rim_heights(face: Face, style: str, turns: np.ndarray, move: tuple[float, float, float]) -> np.ndarray:
    """Heights in F of a style's rim at angles about y, float64 of turns' shape. move: is added to RIMS."""
    share, sides, back = np.add(RIMS[style], move)
    front, top = forehead(face, float(share)), ear_top(face)
    sides, back = sides + top, back + top
    return (
        (front + back + 2 * sides) / 4
        + (front - back) / 2 * np.cos(turns)
        + (front + back - 2 * sides) / 4 * np.cos(2 * turns)
    )


def crown_of(
    face: Face, style: str, columns: int, over: float, move: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Crown:
    """The head above a style's rim. over: mm that hair lifts it. move: of the rim.

    Raises CannotWear where there is no head all round.
    """
    turns = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    height = rim_heights(face, style, turns, move)
    top = float(face.outermost(np.array([0.0, 0.0, 10.0]), np.array([[0.0, 1.0, 0.0]]))[0])
    if not np.isfinite(top) or top < height.max() + 15:
        raise CannotWear("the head has no crown above the forehead")
    centre = np.array([0.0, 0.25 * top, DEPTH_MM])
    level = directions(turns, np.zeros(1))
    start = np.array([0.0, 0.0, centre[2]]) + FAR_MM * level
    start[:, 1] = height
    hits = face.cast(start, -level)
    if not np.isfinite(hits).all():
        raise CannotWear("the head is not there all round")
    _, rim = angles(hits - centre)
    rows = np.linspace(-0.06, 1.0, 30)
    crown = Crown(centre, turns, rim, Taut(np.vstack([np.eye(3) * 9, -np.eye(3) * 9]) + centre, centre))
    samples = crown.towards(rows)
    found = centre + reach(face, centre, samples)[..., None] * samples
    return Crown(centre, turns, rim, Taut(np.vstack([found.reshape(-1, 3), hits]), centre), over)

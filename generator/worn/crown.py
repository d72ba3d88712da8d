# SPDX-License-Identifier: GPL-3.0-or-later
"""The upper head from a rim upwards, as what a hat has to enclose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.worn.face import FAR_MM, Face
from generator.worn.fit import CannotWear
from generator.worn.wrap import Taut, angles, directions, reach

BROWS, HAIRLINE = (105, 334), 10
"""Landmarks."""


@dataclass(frozen=True, eq=False)
class Crown:
    """centre: float64 [3], within the skull, F. turns: float64 [N], angles about y from the front on.
    rim: float64 [N], lift of the rim at each. taut: the hull of what is above the rim.
    """

    centre: np.ndarray
    turns: np.ndarray
    rim: np.ndarray
    taut: Taut

    def lifts(self, rows: np.ndarray) -> np.ndarray:
        """Lift angles [M, N] of rows between 0, the rim, and 1, the top."""
        return self.rim + rows[:, None] * (np.pi / 2 - self.rim)

    def distances(self, rows: np.ndarray) -> np.ndarray:
        """How far the head reaches at rows [M], float64 [M, N]."""
        return self.taut.reach(self.towards(rows))

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


def crown_of(face: Face, front: float, sides: float, back: float, columns: int) -> Crown:
    """The head above a rim with these heights in F. Raises CannotWear where there is no head all round."""
    turns = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    height = (
        (front + back + 2 * sides) / 4
        + (front - back) / 2 * np.cos(turns)
        + (front + back - 2 * sides) / 4 * np.cos(2 * turns)
    )
    top = float(face.outermost(np.array([0.0, 0.0, 10.0]), np.array([[0.0, 1.0, 0.0]]))[0])
    if not np.isfinite(top) or top < height.max() + 15:
        raise CannotWear("the head has no crown above the forehead")
    centre = np.array([0.0, 0.25 * top, 5.0])
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
    return Crown(centre, turns, rim, Taut(np.vstack([found.reshape(-1, 3), hits]), centre))

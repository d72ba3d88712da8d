# SPDX-License-Identifier: GPL-3.0-or-later
"""The skull below hair, as a distance from a centre: where hair grows, and what it may not sink into."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter, grey_opening, map_coordinates, maximum_filter

from generator.heads.mesh import Material
from generator.heads.surroundings import with_triangles
from generator.labels import HAIR
from generator.worn.fit import CannotWear, Fit

TURNS, RISES = 121, 61
"""Samples of azimuth (-180 to 180 degrees) and elevation (-90 to 90): 3 degrees, 5 mm on a head."""

UNIT_MM = 145.0
"""Width of the face between landmarks 234 and 454 of which lengths in millimetres are meant."""

DIGITS = 3
"""Of a millimetre: which of two triangles a ray meets at their edge differs from run to run."""

EAR_MM = 6.0
"""What stands out farther from the side of the head is an ear."""


class Ears(NamedTuple):
    """Where ears are, mean of both sides, mm in frame U."""

    front: float
    back: float
    top: float
    bottom: float


@dataclass(frozen=True, eq=False)
class Skull:
    """A head as seen from the middle of its skull. Azimuth is 0 at the face and grows towards image right.

    centre: float64 [3], frame U, mm. scale: of lengths, 1 for a usual head.
    full: float64 [TURNS, RISES], how far the head reaches, mm, with thick ears. bare: the same without ears.
    ears: where they are. line: elevation of the hairline, radians, float64 [TURNS].
    """

    centre: np.ndarray
    scale: float
    full: np.ndarray
    bare: np.ndarray
    ears: Ears
    line: np.ndarray

    def radius(self, points: np.ndarray, *, ears: bool = False) -> np.ndarray:
        """How far the head reaches in the direction of points [N, 3]: float64 [N], mm."""
        return _look_up(self.full if ears else self.bare, *self.angles(points))

    def angles(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Azimuth and elevation of points [..., 3], radians."""
        away = points - self.centre
        turn = np.arctan2(away[..., 0], away[..., 2])
        return turn, np.arctan2(away[..., 1], np.hypot(away[..., 0], away[..., 2]))

    def point(self, turn: np.ndarray, rise: np.ndarray, lift: np.ndarray | float = 0.0) -> np.ndarray:
        """Points of the skull without ears, lifted by mm: float64 [..., 3]."""
        reach = _look_up(self.bare, turn, rise) + lift
        return self.centre + reach[..., None] * _unit(turn, rise)

    def normal(self, points: np.ndarray) -> np.ndarray:
        """Outward unit normals of the skull in the direction of points: float64 [..., 3]."""
        turn, rise = self.angles(points)
        found = np.stack([_look_up(part, turn, rise) for part in self._normals], axis=-1)
        return found / np.linalg.norm(found, axis=-1, keepdims=True)

    def hairline(self, turn: np.ndarray) -> np.ndarray:
        """Elevation of the hairline, radians, at azimuths."""
        return np.interp(turn, TURN, self.line)

    @cached_property
    def _normals(self) -> np.ndarray:
        # Smooth: strips of hair lie along it, and a bump would comb them.
        reach = gaussian_filter(self.bare, 1.5, mode=("wrap", "nearest"))
        points = reach[..., None] * _unit(*_GRID)
        along = np.gradient(np.concatenate([points[-3:-1], points, points[1:3]]), axis=0)[2:-2]
        up = np.gradient(points, axis=1)
        normals = np.cross(along, up)
        normals[:, [0, -1]] = _unit(*_GRID)[:, [0, -1]]
        normals *= np.sign((normals * _unit(*_GRID)).sum(-1, keepdims=True))
        return np.moveaxis(normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9), 2, 0)


TURN = np.linspace(-np.pi, np.pi, TURNS)
"""Azimuths of the samples, radians."""

_RISE = np.linspace(-np.pi / 2, np.pi / 2, RISES)
_GRID = np.meshgrid(TURN, _RISE, indexing="ij")


def find_skull(fit: Fit) -> Skull:
    """The skull of a head. Raises CannotWear if a landmark is missing, or the head has no back or top."""
    return fit.once("skull", lambda: _found(fit))


def _found(fit: Fit) -> Skull:
    width = fit.at(234, 454)
    scale = float(np.linalg.norm(width[1] - width[0])) / UNIT_MM
    if not 0.3 < scale < 3:
        raise CannotWear("its face is not of a head's size")
    brow = fit.at(105, 334).mean(axis=0)
    forehead = fit.at(151)[0]
    behind = fit.cast(np.array([[forehead[0], brow[1], -1000.0]]), np.array([[0.0, 0.0, 1.0]]))[0]
    if not np.isfinite(behind).all() or forehead[2] - behind[2] < 110 * scale:
        raise CannotWear("the head has no back")
    behind = np.round(behind, DIGITS)
    middle = (fit.at(10)[0, 0] + fit.at(152)[0, 0]) / 2
    centre = np.array([middle, brow[1] + 10 * scale, (forehead[2] + behind[2]) / 2])
    reach = _reach(fit, centre, fit.at(152)[0, 1] - 25 * scale)
    ears = _find_ears(fit, scale)
    bare = _without_ears(reach, centre, ears, scale)
    full = np.maximum(maximum_filter(reach, size=5, mode="nearest"), bare)
    return Skull(centre, scale, full, bare, ears, _hairline(fit, centre, ears, scale))


def _unit(turn: np.ndarray, rise: np.ndarray) -> np.ndarray:
    flat = np.cos(rise)
    return np.stack([np.sin(turn) * flat, np.sin(rise), np.cos(turn) * flat], axis=-1)


def _look_up(grid: np.ndarray, turn: np.ndarray, rise: np.ndarray) -> np.ndarray:
    places = [(turn + np.pi) / (2 * np.pi) * (TURNS - 1), (rise + np.pi / 2) / np.pi * (RISES - 1)]
    return map_coordinates(grid, places, order=1, mode="nearest")


def _reach(fit: Fit, centre: np.ndarray, lowest: float) -> np.ndarray:
    """How far the head reaches, [TURNS, RISES]. What is lower than a height is no head: shoulders."""
    directions = _unit(*_GRID).reshape(-1, 3)
    reach = np.round(fit.outermost(centre, directions), DIGITS).reshape(TURNS, RISES)
    reach[reach <= 0] = np.nan  # through an open neck, the inside of the other side is seen
    missing = ~np.isfinite(reach)
    if missing[:, RISES // 2 + 3 :].mean() > 0.02:
        raise CannotWear("the top of the head has holes")
    reach[centre[1] + reach * directions.reshape(TURNS, RISES, 3)[..., 1] < lowest] = np.nan
    # Below, where the neck ends, the way down goes on as the last that is there.
    for row in reach:
        there = np.flatnonzero(np.isfinite(row))
        if not len(there):
            raise CannotWear("a side of the head is missing")
        row[:] = np.interp(np.arange(RISES), there, row[there])
    # Nape and shoulders are no part of the skull: below its widest place it only gets narrower.
    widest = RISES // 2 - 4
    flat = reach * np.cos(_RISE)
    narrowing = np.minimum.accumulate(flat[:, widest::-1], axis=1)[:, ::-1]
    beside = np.abs(TURN) > np.radians(75)
    reach[beside, : widest + 1] = (narrowing / np.maximum(np.cos(_RISE[: widest + 1]), 0.05))[beside]
    return reach


def _find_ears(fit: Fit, scale: float) -> Ears:
    eye, nose = fit.at(33, 263)[:, 1].mean(), fit.at(2)[0, 1]
    front = fit.at(234, 454)[:, 2].mean()
    usual = Ears(front - 20 * scale, front - 50 * scale, eye, nose)
    y, z = np.meshgrid(
        np.arange(nose - 25 * scale, eye + 22 * scale, 4.0), np.arange(-100.0, 110.0, 4.0), indexing="ij"
    )
    found = []
    for side in (-1.0, 1.0):
        start = np.stack([np.full(y.size, side * 400.0), y.ravel(), z.ravel()], axis=1)
        hits = fit.cast(start, np.tile([-side, 0.0, 0.0], (y.size, 1)))[:, 0].reshape(y.shape) * side
        profile = np.round(np.where(np.isfinite(hits), hits, 0.0), DIGITS)
        bump = profile - grey_opening(profile, size=(1, 17))
        stands = (bump > EAR_MM * scale) & (z < front + 20 * scale) & (z > front - 110 * scale)
        if stands.sum() >= 12:
            # Hair that was modelled and the corner of the jaw stand out, too.
            middle = float(np.average(z[stands], weights=bump[stands]))
            back, ahead = np.clip(np.percentile(z[stands], [3, 97]), middle - 22 * scale, middle + 20 * scale)
            low, high = np.percentile(y[stands], [2, 98])
            found.append((ahead, back, min(high, eye + 10 * scale), low))
    return Ears(*np.mean(found, axis=0)) if found else usual


def _without_ears(full: np.ndarray, centre: np.ndarray, ears: Ears, scale: float) -> np.ndarray:
    """The reach where ears are is that between their front and their back."""
    points = centre + full[..., None] * _unit(*_GRID)
    margin = 8 * scale
    ear = (np.abs(points[..., 0] - centre[0]) > 45 * scale) & (points[..., 1] < ears.top + margin)
    ear &= (points[..., 1] > ears.bottom - margin) & (points[..., 2] < ears.front + 0.6 * margin)
    ear &= points[..., 2] > ears.back - margin
    bare = full.copy()
    for column in range(RISES):
        gone = ear[:, column]
        if gone.any() and not gone.all():
            bare[gone, column] = np.interp(TURN[gone], TURN[~gone], bare[~gone, column])
    return bare


def _hairline(fit: Fit, centre: np.ndarray, ears: Ears, scale: float) -> np.ndarray:
    """Usual hairline: over the forehead, down the temples, around the ears, to the nape."""
    sides = []
    eye, nose, mouth = fit.at(33, 263)[:, 1].mean(), fit.at(2)[0, 1], fit.at(13)[0, 1]
    for side, places in ((-1.0, (10, 67, 103, 54, 21, 162)), (1.0, (10, 297, 332, 284, 251, 389))):
        marks = fit.at(*places) - centre
        turn = np.arctan2(np.abs(marks[:, 0]), marks[:, 2])
        rise = np.arctan2(marks[:, 1], np.hypot(marks[:, 0], marks[:, 2]))
        turn[0] = 0.0
        turn += np.radians([0, 0, 1, 2, 6, 9])
        rise += np.radians([6, 6, 7, 7, 2, -2])
        half = abs(float(fit.at(234 if side < 0 else 454)[0, 0] - centre[0]))
        around = np.array(
            [
                [ears.front + 11 * scale, eye - 14 * scale],
                [ears.front + 3 * scale, ears.top + 1 * scale],
                [(ears.front + ears.back) / 2, ears.top + 5 * scale],
                [ears.back - 3 * scale, ears.top - 6 * scale],
                [ears.back - 12 * scale, 0.6 * nose + 0.4 * eye],
            ]
        )
        z, y = around[:, 0] - centre[2], around[:, 1] - centre[1]
        turn = np.append(turn, np.arctan2(half, z))
        rise = np.append(rise, np.arctan2(y, np.hypot(half, z)))
        turn = np.append(turn, np.radians([145, 180]))
        rise = np.append(rise, np.arctan2(np.array([nose - 8 * scale, mouth]) - centre[1], 88 * scale))
        # Elevation is a function of azimuth: a line that goes straight down is a little oblique.
        for k in range(1, len(turn)):
            turn[k] = max(turn[k], turn[k - 1] + 0.02)
        turn *= np.pi / turn[-1] if turn[-1] > np.pi else 1.0
        sides.append(PchipInterpolator(turn, rise)(np.abs(TURN)))
    return np.where(TURN < 0, sides[0], sides[1])


def without_hair(fit: Fit) -> Fit:
    """A head without the long hair that is a part of its mesh."""
    hair = np.array([is_hair(material) for material in fit.mesh.materials])[fit.mesh.material_index]
    return replace(fit, mesh=with_triangles(fit.mesh, ~hair)) if hair.any() else fit


def is_hair(material: Material) -> bool:
    """Is it hair that hangs from a head?"""
    return material.label == HAIR or material.name == "hair"

# SPDX-License-Identifier: GPL-3.0-or-later
"""The lower face as it is seen from within the mouth: where a beard grows, and what it lies on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from generator.landmarks.topology import FACE_MESH
from generator.worn.complexion import surface_colors
from generator.worn.fit import CannotWear, Fit
from generator.worn.skull import UNIT_MM

TURNS, RISES = 97, 57
TURN_RAD, RISE_RAD = np.radians([-120.0, 120.0]), np.radians([-85.0, 55.0])
"""What is sampled around the middle: 2.5 degrees, 4 mm."""

GRID = np.stack(
    np.meshgrid(
        np.linspace(TURN_RAD[0], TURN_RAD[1], TURNS),
        np.linspace(RISE_RAD[0], RISE_RAD[1], RISES),
        indexing="ij",
    ),
    axis=-1,
)
"""Azimuth and elevation of each sample, [TURNS, RISES, 2]."""

LIPS = (61, 185, 40, 39, 37, 0, 267, 269, 270, 409, 291, 375, 321, 405, 314, 17, 84, 181, 91, 146)
"""Landmarks around the lips."""

Mark = tuple[tuple[int, ...], tuple[float, float, float]]
"""A corner of an area: the mean of some landmarks at image left, and how far from it, mm."""


def _at(*places: int, by: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mark:
    return places, by


_UNDER_NOSE = (_at(2, by=(0, -1, 0)), _at(97, by=(0, -1, 0)), _at(98, by=(0, -2, 0)))
AREAS: dict[str, tuple[Mark, ...]] = {
    "full": (
        *_UNDER_NOSE, _at(206, 216), _at(207, by=(0, -3, 0)), _at(147, 177, by=(0, -2, 0)), _at(137),
        _at(127),
        _at(127, 234, by=(0, 0, -16)), _at(132, by=(0, 0, -14)), _at(58, by=(0, -12, -10)),
        _at(172, by=(0, -17, -16)), _at(136, by=(0, -17, -22)), _at(149, by=(0, -14, -30)),
        _at(152, by=(0, -10, -38)),
    ),
    "goatee": (
        *_UNDER_NOSE, _at(206, 216, 61), _at(212, 57, by=(1, 0, 0)), _at(202, by=(1, 0, 0)), _at(211),
        _at(170, by=(4, -6, 0)), _at(171, by=(-8, -10, -10)), _at(152, by=(0, -8, -20)),
    ),
    "moustache": (
        *_UNDER_NOSE, _at(206, 216, 61), _at(57, 212, by=(3, -1, 0)), _at(57, by=(4, -6, 0)),
        _at(61, by=(3, -1, 0)),
        _at(0, by=(0, -8, 0)),
    ),
}  # fmt: skip
"""Outlines of image left from the middle out and around; image right is their mirror image."""


@dataclass(frozen=True, eq=False)
class LowerFace:
    """middle: float64 [3], mm, of the rays; scale: of lengths. surface: float64 [TURNS, RISES, 3], NaN where
    the head has none. lips: their outline as azimuth and elevation, [20, 2]."""

    fit: Fit
    middle: np.ndarray
    scale: float
    surface: np.ndarray
    lips: np.ndarray

    def angles(self, points: np.ndarray) -> np.ndarray:
        """Azimuth and elevation [..., 2] of points [..., 3], radians."""
        away = points - self.middle
        turn = np.arctan2(away[..., 0], away[..., 2])
        return np.stack([turn, np.arctan2(away[..., 1], np.hypot(away[..., 0], away[..., 2]))], axis=-1)

    def outline(self, marks: Sequence[Mark]) -> np.ndarray:
        """An area as a polygon of azimuth and elevation, [2 M, 2]."""
        pairs = FACE_MESH.mirror_pairs()
        left, right = [], []
        for places, by in marks:
            move = np.array(by) * self.scale
            left.append(self.fit.at(*places).mean(axis=0) + move)
            right.append(self.fit.at(*pairs[list(places)]).mean(axis=0) + move * [-1, 1, 1])
        return self.angles(np.array(left + right[::-1]))

    def on_lips(self, points: np.ndarray, wider: float = 1.0) -> np.ndarray:
        """Which points [..., 3] are before or on the lips, bool [...]."""
        middle = self.lips.mean(axis=0)
        return within(self.angles(points), middle + wider * (self.lips - middle))

    def place(self, angles: np.ndarray) -> np.ndarray:
        """Points of the surface at azimuth and elevation [N, 2]: float64 [N, 3]; NaN where there is none."""
        return np.stack([_look_up(self.surface[..., k], angles) for k in range(3)], axis=1)

    def normal(self, angles: np.ndarray) -> np.ndarray:
        """Outward unit normals there, float64 [N, 3]."""
        filled = np.where(np.isfinite(self.surface), self.surface, self.middle)
        smooth = np.stack([gaussian_filter(filled[..., k], 1.2) for k in range(3)], axis=-1)
        along, up = np.gradient(smooth, axis=0), np.gradient(smooth, axis=1)
        normals = np.cross(along, up)
        found = np.stack([_look_up(normals[..., k], angles) for k in range(3)], axis=1)
        return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9)

    def skin(self, points: np.ndarray) -> np.ndarray:
        """Colour of the head below points [N, 3] of the surface, sRGB [N, 3]; NaN where rays miss."""
        out = points - self.middle
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        return surface_colors(self.fit, points + 60 * out, -out)


def find_lower_face(fit: Fit) -> LowerFace:
    """Raises CannotWear if a landmark is missing."""
    sides, mouth = fit.at(234, 454), fit.at(13)[0]
    scale = float(np.linalg.norm(sides[1] - sides[0])) / UNIT_MM
    if not 0.3 < scale < 3:
        raise CannotWear("its face is not of a head's size")
    middle = np.array([sides[:, 0].mean(), mouth[1] + 4 * scale, sides[:, 2].mean() - 6 * scale])
    turn, rise = GRID[..., 0], GRID[..., 1]
    flat = np.cos(rise)
    out = np.stack([np.sin(turn) * flat, np.sin(rise), np.cos(turn) * flat], axis=-1).reshape(-1, 3)
    reach = np.round(fit.outermost(middle, out), 3)
    reach[~(reach > 20 * scale)] = np.nan
    surface = (middle + reach[:, None] * out).reshape(TURNS, RISES, 3)
    face = LowerFace(fit, middle, scale, surface, np.zeros((0, 2)))
    lips = face.angles(fit.at(*LIPS))
    return LowerFace(fit, middle, scale, surface, lips)


def within(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Which points [..., 2] lie in a polygon [M, 2]: bool [...], by the even-odd rule."""
    x, y = points[..., 0], points[..., 1]
    inside = np.zeros(x.shape, dtype=bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def _look_up(grid: np.ndarray, angles: np.ndarray) -> np.ndarray:
    turn = (angles[:, 0] - TURN_RAD[0]) / np.ptp(TURN_RAD) * (TURNS - 1)
    rise = (angles[:, 1] - RISE_RAD[0]) / np.ptp(RISE_RAD) * (RISES - 1)
    return map_coordinates(grid, [turn, rise], order=1, mode="nearest")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Cloth drawn over a head: the taut surface over what it covers, seen from a point inside."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.spatial import ConvexHull, QhullError

from generator.worn.face import Face
from generator.worn.fit import CannotWear

RAYS = 256


def directions(turn: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """Unit vectors in F of angles in radians: turn about y, 0 is forward and above zero right; lift is up."""
    turn, lift = np.broadcast_arrays(turn, lift)
    return np.stack([np.sin(turn) * np.cos(lift), np.sin(lift), np.cos(turn) * np.cos(lift)], axis=-1)


def angles(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inverse: turn and lift of vectors [..., 3]."""
    level = np.hypot(offsets[..., 0], offsets[..., 2])
    return np.arctan2(offsets[..., 0], offsets[..., 2]), np.arctan2(offsets[..., 1], level)


def reach(face: Face, centre: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How far the head reaches from a point along unit vectors [..., 3], float64 [...]; NaN: nowhere."""
    return face.outermost(centre, towards.reshape(-1, 3)).reshape(towards.shape[:-1])


class Taut:
    """The convex hull of points, as a surface around a centre within.

    points: float [N, 3]. Raises CannotWear where they have no volume around the centre.
    """

    def __init__(self, points: np.ndarray, centre: np.ndarray) -> None:
        known = points[np.isfinite(points).all(axis=1)]
        try:
            equations = np.unique(ConvexHull(known - centre).equations.round(9), axis=0)
        except (QhullError, ValueError) as error:
            raise CannotWear("too little of the head is there for it") from error
        self._centre = centre
        self._normals, self._distances = equations[:, :3], -equations[:, 3]
        if self._distances.min() <= 0:
            raise CannotWear("the head is not shaped as one there")

    def reach(self, towards: np.ndarray, origins: np.ndarray | None = None) -> np.ndarray:
        """How far it reaches along unit vectors [..., 3], float64 [...].

        origins: of each, float [..., 3], or the centre. From outside, a number below zero may come.
        """
        rays = towards.reshape(-1, 3)
        some = range(0, len(rays), RAYS)  # not all at once: a hull has thousands of planes
        if origins is None:
            poles = self._normals / self._distances[:, None]
            lengths = [1 / (rays[k : k + RAYS] @ poles.T).max(axis=1) for k in some]
        else:
            away = (origins - self._centre).reshape(-1, 3)
            lengths = [self._exit(away[k : k + RAYS], rays[k : k + RAYS]) for k in some]
        return np.concatenate(lengths).reshape(towards.shape[:-1])

    def _exit(self, origins: np.ndarray, rays: np.ndarray) -> np.ndarray:
        facing = rays @ self._normals.T
        room = self._distances - origins @ self._normals.T
        # Of planes that a ray does not face the exit is far, far away.
        return (room / np.maximum(facing, 1e-9)).min(axis=1)


def smoothed(values: np.ndarray, sigma: float | tuple[float, float], around: bool = False) -> np.ndarray:
    """A smooth surface that is nowhere below values [M, N]. around: the last column meets the first."""
    mode = ("nearest", "wrap" if around else "nearest")
    smooth = gaussian_filter(values, sigma, mode=mode)
    lacking = maximum_filter(np.maximum(values - smooth, 0), size=3, mode=mode)
    return np.maximum(smooth + gaussian_filter(lacking, 1.0, mode=mode), values)


def step(values: np.ndarray) -> np.ndarray:
    """Smoothly from 0 at 0 to 1 at 1."""
    share = np.clip(values, 0, 1)
    return share * share * (3 - 2 * share)

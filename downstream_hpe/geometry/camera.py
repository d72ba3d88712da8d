# SPDX-License-Identifier: MIT
"""A pinhole camera, and where a head of known shape and rotation is before it.

A point X of the head (mm, frame C, pivot at the origin) is seen at K (R_C X + t). R_C is the head as seen
along the optical axis. As seen towards the face, from the camera turned until the pivot is on its axis,
the head is A^T R_C, where A turns the optical axis by the shortest way into the direction of t: what an
estimate that knows nothing of K reads, since a crop around the face looks the same from both cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Camera:
    """matrix: K, float64 [3, 3], pixels; the centre of the first pixel is (0.5, 0.5). guessed: no one said
    what it is."""

    matrix: np.ndarray
    guessed: bool = False

    @staticmethod
    def from_fov(fov_deg: float, width: float, height: float, guessed: bool = False) -> Camera:
        """The camera whose picture of width x height pixels sees fov_deg along its longer side."""
        focal = max(width, height) / 2 / np.tan(np.deg2rad(fov_deg) / 2)
        return Camera(np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]]), guessed)

    @property
    def focal_px(self) -> float:
        """Focal length, pixels; of two, along x and y, their geometric mean."""
        return float(np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))

    @cached_property
    def inverse(self) -> np.ndarray:
        """K^-1, float64 [3, 3]."""
        return np.linalg.inv(self.matrix)

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Directions of pixels, z = 1, frame C: float [..., 2] -> float64 [..., 3]."""
        ones = np.ones((*pixels.shape[:-1], 1))
        return np.concatenate([pixels, ones], axis=-1) @ self.inverse.T

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Where points before the camera are seen: float [..., 3], frame C -> float64 [..., 2]."""
        seen = points @ self.matrix.T
        return seen[..., :2] / seen[..., 2:]


def aimed_at(direction: np.ndarray) -> np.ndarray:
    """A: the shortest rotation of the optical axis into a direction, float [..., 3] -> float64 [..., 3, 3].

    The direction has z > 0. Rodrigues with axis z x d, whose sine and cosine are those of the angle.
    """
    x, y, z = np.moveaxis(direction / np.linalg.norm(direction, axis=-1, keepdims=True), -1, 0)
    share = 1 / (1 + z)
    rows = [[1 - x * x * share, -x * y * share, x], [-x * y * share, 1 - y * y * share, y], [-x, -y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def seen_towards(landmarks: np.ndarray, camera: Camera, aim: np.ndarray) -> np.ndarray:
    """Landmarks as the camera would see them if it were turned by aim: the perspective of the edge undone.

    x and y by the homography of that turn, exactly. z, which is along the line of sight already, is scaled
    with them. landmarks: float [N, 468, 3], isotropic pixels, frame C; aim: [N, 3, 3] -> float64 [N, 468, 3].
    """
    before = landmarks[..., :2].astype(np.float64)
    after = camera.pixels(camera.rays(before) @ aim)
    depth = landmarks[..., 2:] * (_spread(after) / _spread(before))[:, None, None]
    return np.concatenate([after, depth], axis=-1)


def fit_translation(
    head_mm: np.ndarray, rotation: np.ndarray, pixels: np.ndarray, camera: Camera
) -> np.ndarray:
    """t for which a head turned by rotation is seen at pixels, in the least squares of what is linear in t:

        X + t_x = x (Z + t_z),  Y + t_y = y (Z + t_z),  with (X, Y, Z) = R_C head and (x, y, 1) = K^-1 pixel

    Exact where head, rotation and pixels are. The scale is the head's: one that is really larger by a
    tenth is farther away by a tenth.

    Parameters
    ----------
    head_mm: float [P, 3], frame C; rotation: R_C, [N, 3, 3]; pixels: [N, P, 2].

    Returns
    -------
    float64 [N, 3], mm, frame C; NaN where the fit is not before the camera.
    """
    turned = head_mm @ np.swapaxes(rotation, -1, -2)
    x, y, _ = np.moveaxis(camera.rays(pixels.astype(np.float64)), -1, 0)
    right = x * turned[..., 2] - turned[..., 0], y * turned[..., 2] - turned[..., 1]
    # The normal equations of the rows (1, 0, -x) and (0, 1, -y).
    count, sums = np.full(len(x), float(x.shape[1])), (x.sum(axis=1), y.sum(axis=1))
    nothing = np.zeros(len(x))
    normal = np.stack(
        [
            np.stack([count, nothing, -sums[0]], axis=-1),
            np.stack([nothing, count, -sums[1]], axis=-1),
            np.stack([-sums[0], -sums[1], (x * x + y * y).sum(axis=1)], axis=-1),
        ],
        axis=-2,
    )
    known = np.stack(
        [right[0].sum(axis=1), right[1].sum(axis=1), -(x * right[0] + y * right[1]).sum(axis=1)], axis=-1
    )
    found = np.linalg.solve(normal, known[..., None])[..., 0]
    before = (found[:, 2:] > 0) & (turned[..., 2] + found[:, 2:] > 0).all(axis=1, keepdims=True)
    return np.where(before, found, np.nan)


def _spread(pixels: np.ndarray) -> np.ndarray:
    """RMS distance to the centre, [N]."""
    return np.sqrt(np.square(pixels - pixels.mean(axis=1, keepdims=True)).sum(axis=-1).mean(axis=1))

# SPDX-License-Identifier: MIT
"""Where a head is, and how it is turned relative to the optical axis, from what was estimated of its face."""

from __future__ import annotations

import numpy as np

from downstream_hpe.geometry.camera import Camera, aimed_at, fit_translation, seen_towards
from downstream_hpe.geometry.mean_head import mean_head

ROUNDS = 6
"""The direction of the pivot depends on the rotation relative to the axis, and that on the direction: a
round leaves a tenth of the error or less."""


def place(landmarks: np.ndarray, towards: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Rotation relative to the optical axis, R_C, float64 [N, 3, 3], and translation in mm, [N, 3].

    landmarks: [N, 468, 3], pixels of the camera. towards: [N, 3, 3], the rotation as seen towards the face.
    Both are NaN where no place before the camera fits.
    """
    pixels = landmarks[..., :2]
    aim = aimed_at(camera.rays(pixels.mean(axis=1)))
    for _ in range(ROUNDS):
        translation = fit_translation(mean_head(), aim @ towards, pixels, camera)
        aim = aimed_at(translation)
    return aim @ towards, translation


def undone(landmarks: np.ndarray, towards: np.ndarray, camera: Camera) -> np.ndarray:
    """Landmarks [N, 468, 3] as seen from the camera turned towards each head's pivot; where no place fits,
    as they are. Arguments as :func:`place`, towards a first estimate."""
    _, translation = place(landmarks, towards, camera)
    placed = np.isfinite(translation).all(axis=1)
    ahead = np.where(placed[:, None], translation, [0.0, 0.0, 1.0])
    seen = seen_towards(landmarks, camera, aimed_at(ahead))
    return np.where(placed[:, None, None], seen, landmarks)

# SPDX-License-Identifier: MIT
"""Faces that were not in the training set, made from those that were.

Everything starts from level faces: landmarks turned back by their own R_C. What is done to a level
face changes who it is; what is done after it is turned again is what a lens or a detector does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from downstream_hpe.geometry.face_mesh import mirror_pairs
from downstream_hpe.geometry.rotation import rotation_from_angles

_MIRROR = np.array([-1.0, 1.0, 1.0], dtype=np.float32)


@dataclass(frozen=True)
class Disturbances:
    """How far training faces are moved from what was measured; 0 leaves a thing as it is.

    turn_deg: of the random turn about each axis. mirror: share of faces mirrored. shape: of the share of
    the difference of two heads of :func:`shapes_of` that is added. stretch: of each axis of the level
    face. depth: of the landmarks' depth. lean: of that depth's slope across the image, which is what a
    detector knows least. lens: of the change of perspective, 1 / distance in units of the face's RMS
    radius. jitter: of a point, in the same units. All but mirror are standard deviations of normal draws;
    stretch and depth relative.
    """

    turn_deg: float = 10.0
    mirror: float = 0.5
    shape: float = 1.0
    stretch: float = 0.06
    depth: float = 0.04
    lean: float = 0.03
    lens: float = 0.02
    jitter: float = 0.005


NONE = Disturbances(turn_deg=0, mirror=0, shape=0, stretch=0, depth=0, lean=0, lens=0, jitter=0)


def levelled(landmarks: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Landmarks [N, 468, 3] turned back by R_C [N, 3, 3]: rows x^T R = (R^T x)^T."""
    return landmarks @ rotation.astype(landmarks.dtype)


def shapes_of(
    level: np.ndarray, heads: np.ndarray, ypr_deg: np.ndarray, near_deg: float = 35.0
) -> np.ndarray:
    """The mean level face of each head, over its poses within near_deg of the front.

    level: float32 [N, 468, 3]; heads: str [N]; ypr_deg: float [N, 3].

    Differences of these are faces' differences: being level, they change no pose.

    Returns
    -------
    float32 [H, 468, 3]; heads without such a pose are left out, and partial faces.
    """
    near = (np.abs(ypr_deg).max(axis=1) <= near_deg) & ~np.isnan(level).any(axis=(1, 2))
    _, index = np.unique(heads[near], return_inverse=True)
    count = np.bincount(index)
    total = np.zeros((len(count), *level.shape[1:]), dtype=np.float64)
    np.add.at(total, index, level[near])
    return (total / count[:, None, None]).astype(np.float32)


def disturbed(
    level: np.ndarray,
    rotation: np.ndarray,
    shapes: np.ndarray,
    how: Disturbances,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Faces of other people, at other poses, through other lenses.

    Parameters
    ----------
    level: float32 [B, 468, 3], normalised and level, NaN where not seen. rotation: R_C, float64 [B, 3, 3].
    shapes: float32 [H, 468, 3], of :func:`shapes_of`.

    Returns
    -------
    landmarks float32 [B, 468, 3], not normalised, and R_C float64 [B, 3, 3].
    """
    count = len(level)
    flipped = rng.random(count) < how.mirror
    faces = np.where(flipped[:, None, None], level[:, mirror_pairs()] * _MIRROR, level)
    signs = np.where(flipped[:, None], _MIRROR.astype(np.float64), 1.0)
    poses = signs[:, :, None] * rotation * signs[:, None, :]
    if how.shape and len(shapes) > 1:
        one, other = rng.integers(len(shapes), size=(2, count))
        faces = faces + _normal(rng, how.shape, count) * (shapes[one] - shapes[other])
    faces = faces * (1 + rng.normal(scale=how.stretch, size=(count, 1, 3)).astype(np.float32))
    # Small turns about all three axes: the composition of Euler angles is close enough to isotropic.
    poses = rotation_from_angles(rng.normal(scale=how.turn_deg, size=(count, 3))) @ poses
    turned = faces @ np.swapaxes(poses, -1, -2).astype(np.float32)
    turned[..., :2] *= 1 - _normal(rng, how.lens, count) * turned[..., 2:]
    turned[..., 2:] *= 1 + _normal(rng, how.depth, count)
    slope = rng.normal(scale=how.lean, size=(count, 2, 1)).astype(np.float32)
    turned[..., 2:] += turned[..., :2] @ slope
    noise = rng.standard_normal(turned.shape, dtype=np.float32) * np.float32(how.jitter)
    return turned + noise, poses


def _normal(rng: np.random.Generator, scale: float, count: int) -> np.ndarray:
    return rng.normal(scale=scale, size=(count, 1, 1)).astype(np.float32)

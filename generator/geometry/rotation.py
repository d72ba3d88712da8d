# SPDX-License-Identifier: GPL-3.0-or-later
"""The one rotation of the dataset, and everything derived from it.

Frames, signs and test vectors: ``docs/conventions.md``. In short, all frames
are right-handed, rotations are active and act on column vectors:

* **C**, camera: x image-right, y image-down, z into the scene;
* **U**, graphics: x image-right, y up, z towards the viewer;
* **B**, Blender world: x image-right, y into the scene, z up.

Angles are degrees and always in the order (yaw, pitch, roll). yaw > 0 turns
the nose to image left, pitch > 0 lifts it, roll > 0 leans the crown to image
right.
"""

from __future__ import annotations

import numpy as np

CAMERA_FROM_GRAPHICS = np.diag([1.0, -1.0, -1.0])
"""D: frame U to frame C, and back."""

BLENDER_FROM_GRAPHICS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Q: frame U to frame B."""

MIRROR = np.diag([1.0, 1.0, -1.0])
"""S: frame C to the left-handed frame of TriNet and NLML-HPE."""


def rotation_from_angles(ypr_deg: np.ndarray) -> np.ndarray:
    """R_C = Rx(-pitch) Ry(yaw) Rz(roll): intrinsic X-Y-Z in the camera frame.

    Parameters
    ----------
    ypr_deg: float [..., 3], (yaw, pitch, roll) in degrees.

    Returns
    -------
    float64 [..., 3, 3], the rotation that turns the head from pose zero.

    Raises
    ------
    ValueError: the last axis is not 3 long, or an angle is not finite.
    """
    angles = np.asarray(ypr_deg, dtype=np.float64)
    if angles.shape[-1:] != (3,):
        raise ValueError(f"expected angles of shape [..., 3] (yaw, pitch, roll), got {angles.shape}")
    if not np.isfinite(angles).all():
        raise ValueError("yaw, pitch and roll must be finite numbers of degrees")
    yaw, pitch, roll = np.moveaxis(np.deg2rad(angles), -1, 0)
    cy, sy = np.cos(yaw), np.sin(yaw)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cr, sr = np.cos(roll), np.sin(roll)
    rows = [
        [cy * cr, -cy * sr, sy],
        [cp * sr - sp * sy * cr, cp * cr + sp * sy * sr, sp * cy],
        [-sp * sr - cp * sy * cr, -sp * cr + cp * sy * sr, cp * cy],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """(yaw, pitch, roll) in degrees of R_C, the inverse of :func:`rotation_from_angles`.

    Parameters
    ----------
    rotation: float [..., 3, 3], R_C.

    Returns
    -------
    float64 [..., 3]; yaw in [-90, 90], pitch and roll in (-180, 180].
    At yaw = ±90° (gimbal lock) only pitch ± roll is determined.
    """
    r = np.asarray(rotation, dtype=np.float64)
    yaw = np.arcsin(np.clip(r[..., 0, 2], -1.0, 1.0))
    pitch = np.arctan2(r[..., 1, 2], r[..., 2, 2])
    roll = np.arctan2(-r[..., 0, 1], r[..., 0, 0])
    return np.rad2deg(np.stack([yaw, pitch, roll], axis=-1))


def graphics_rotation(rotation: np.ndarray) -> np.ndarray:
    """R_U = D R_C D, the matrix of 300W-LP and 3DDFA. [..., 3, 3] -> [..., 3, 3]."""
    return CAMERA_FROM_GRAPHICS @ np.asarray(rotation) @ CAMERA_FROM_GRAPHICS


def blender_rotation(rotation: np.ndarray) -> np.ndarray:
    """R_B = Q R_U Q^T, the object matrix in Blender's world. [..., 3, 3] -> [..., 3, 3]."""
    return BLENDER_FROM_GRAPHICS @ graphics_rotation(rotation) @ BLENDER_FROM_GRAPHICS.T


def quaternion_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion wxyz with w >= 0 of a rotation.

    Shepperd's method (J. Guidance and Control 1(3), 1978): divides by the
    largest of the four components, so no pose loses digits.

    Parameters
    ----------
    rotation: float [..., 3, 3].

    Returns
    -------
    float64 [..., 4].
    """
    r = np.asarray(rotation, dtype=np.float64)
    m00, m11, m22 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    x = r[..., 2, 1] - r[..., 1, 2]
    y = r[..., 0, 2] - r[..., 2, 0]
    z = r[..., 1, 0] - r[..., 0, 1]
    xy = r[..., 0, 1] + r[..., 1, 0]
    xz = r[..., 0, 2] + r[..., 2, 0]
    yz = r[..., 1, 2] + r[..., 2, 1]
    # Row k holds 4 q_k (w, x, y, z); the row of the largest q_k is the exact one.
    candidates = np.stack(
        [
            np.stack([1 + m00 + m11 + m22, x, y, z], axis=-1),
            np.stack([x, 1 + m00 - m11 - m22, xy, xz], axis=-1),
            np.stack([y, xy, 1 - m00 + m11 - m22, yz], axis=-1),
            np.stack([z, xz, yz, 1 - m00 - m11 + m22], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def rotation_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion wxyz. [..., 4] -> [..., 3, 3]."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def geodesic_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle of a^T b in degrees, stable near 0 and 180. [..., 3, 3] x 2 -> [...]."""
    relative = np.swapaxes(np.asarray(a, dtype=np.float64), -1, -2) @ np.asarray(b, dtype=np.float64)
    q = quaternion_from_rotation(relative)
    return np.rad2deg(2 * np.arctan2(np.linalg.norm(q[..., 1:], axis=-1), q[..., 0]))

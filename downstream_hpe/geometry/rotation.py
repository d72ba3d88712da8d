# SPDX-License-Identifier: MIT
"""The rotation of the tables, R_C = Rx(-pitch) Ry(yaw) Rz(roll), and its inverse.

Frame C: x image-right, y image-down, z into the scene. yaw > 0 turns the nose to image left,
pitch > 0 lifts it, roll > 0 leans the crown to image right. Test vectors: docs/conventions.md.
"""

from __future__ import annotations

import numpy as np

ANGLES = ("yaw", "pitch", "roll")
"""In the order of every array of angles."""


def rotation_from_angles(ypr_deg: np.ndarray) -> np.ndarray:
    """R_C of (yaw, pitch, roll) in degrees: float [..., 3] -> float64 [..., 3, 3]."""
    yaw, pitch, roll = np.moveaxis(np.deg2rad(np.asarray(ypr_deg, dtype=np.float64)), -1, 0)
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    cr, sr = np.cos(roll), np.sin(roll)
    rows = [
        [cy * cr, -cy * sr, sy],
        [cp * sr - sp * sy * cr, cp * cr + sp * sy * sr, sp * cy],
        [-sp * sr - cp * sy * cr, -sp * cr + cp * sy * sr, cp * cy],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """(yaw, pitch, roll) in degrees of R_C: float [..., 3, 3] -> float64 [..., 3].

    yaw in [-90, 90], the others in (-180, 180]; at yaw = ±90° only pitch ± roll is determined.
    """
    r = np.asarray(rotation, dtype=np.float64)
    yaw = np.arcsin(np.clip(r[..., 0, 2], -1.0, 1.0))
    pitch = np.arctan2(r[..., 1, 2], r[..., 2, 2])
    roll = np.arctan2(-r[..., 0, 1], r[..., 0, 0])
    return np.rad2deg(np.stack([yaw, pitch, roll], axis=-1))


def fit_rotation(source: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """The rotation of the least-squares similarity that maps source onto each target.

    Umeyama, IEEE TPAMI 13(4), 1991, Eqs. 40-43; scale and translation are free.

    Parameters
    ----------
    source: float [P, 3]; targets: float [N, P, 3], row i corresponds to row i; NaN where there is no point.

    Returns
    -------
    float64 [N, 3, 3], proper rotations.
    """
    a = source - source.mean(axis=0)
    if np.isnan(targets).any():
        # With targets about the centre of those that there are, it does not matter where the source's is.
        targets = np.nan_to_num(targets - np.nanmean(targets, axis=1, keepdims=True))
    b = targets - targets.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("npi,pj->nij", b, a))
    sign = np.ones((len(b), 3))
    sign[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return (u * sign[:, None, :]) @ vt

# SPDX-License-Identifier: GPL-3.0-or-later
"""Best similarity between two point sets (Umeyama 1991)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Similarity:
    """target ~ scale * rotation @ source + translation.

    rotation [3, 3] proper; translation [3] and rms in the target's units.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray
    rms: float


def fit_similarity(source: np.ndarray, target: np.ndarray) -> Similarity:
    """Least-squares similarity that maps source onto target.

    Umeyama, "Least-squares estimation of transformation parameters between two
    point patterns", IEEE TPAMI 13(4), 1991, Eqs. 40-43.

    Parameters
    ----------
    source, target: float [N, 3], N >= 3, row i corresponds to row i.

    Raises
    ------
    ValueError: shapes differ, a value is not finite, or the points of either
        set coincide.
    """
    a = np.asarray(source, dtype=np.float64)
    b = np.asarray(target, dtype=np.float64)
    if a.shape != b.shape or a.ndim != 2 or a.shape[1] != 3 or len(a) < 3:
        raise ValueError(f"expected two point sets of equal shape [N >= 3, 3], got {a.shape} and {b.shape}")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("cannot fit points that are not finite")
    mean_a, mean_b = a.mean(0), b.mean(0)
    a0, b0 = a - mean_a, b - mean_b
    variance = (a0**2).sum() / len(a)
    if variance == 0 or not b0.any():
        raise ValueError("cannot fit a rotation to points that all coincide")
    u, singular, vt = np.linalg.svd(b0.T @ a0 / len(a))
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = (u * sign) @ vt
    scale = float((singular * sign).sum() / variance)
    translation = mean_b - scale * rotation @ mean_a
    residual = b - (scale * a @ rotation.T + translation)
    return Similarity(scale, rotation, translation, float(np.sqrt((residual**2).sum(1).mean())))


def fit_rotations(source: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """The rotations of :func:`fit_similarity` from one point set to many, at once.

    Parameters
    ----------
    source: float [N, 3]; targets: float [M, N, 3], row i corresponds to row i.

    Returns
    -------
    float64 [M, 3, 3], proper.
    """
    a = np.asarray(source, dtype=np.float64)
    b = np.asarray(targets, dtype=np.float64)
    cross = np.swapaxes(b - b.mean(axis=1, keepdims=True), 1, 2) @ (a - a.mean(axis=0))
    u, _, vt = np.linalg.svd(cross)
    sign = np.ones((len(b), 1, 3))
    sign[:, 0, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return (u * sign) @ vt

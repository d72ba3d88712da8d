# SPDX-License-Identifier: MIT
"""Errors of a pose estimate: Euler, axis (MAEV) and geodesic, in degrees.

Euler error alone is not a valid metric near gimbal lock (Cobo et al., arXiv 2408.01566), so all
three are always computed.
"""

from __future__ import annotations

import numpy as np

SURE_DEG = 5.0
"""Confidence is the probability of a geodesic error below it."""


def euler_errors(predicted_deg: np.ndarray, true_deg: np.ndarray) -> np.ndarray:
    """|difference| an angle, without wrapping: a 180° error stays one. float [N, 3] x 2 -> [N, 3]."""
    return np.abs(np.asarray(predicted_deg, dtype=np.float64) - np.asarray(true_deg, dtype=np.float64))


def axis_errors(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angles between corresponding columns of two rotations, degrees; their mean is MAEV.

    float [..., 3, 3] x 2 -> [..., 3]. The angle is 2 atan2(|u - v|, |u + v|), exact near 0 and 180.
    """
    u, v = np.asarray(predicted, dtype=np.float64), np.asarray(true, dtype=np.float64)
    return np.rad2deg(2 * np.arctan2(np.linalg.norm(u - v, axis=-2), np.linalg.norm(u + v, axis=-2)))


def geodesic_errors(predicted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """The angle of predicted^T true, degrees: float [..., 3, 3] x 2 -> [...].

    |R - I|_F = 2 sqrt(2) sin(angle / 2) and trace + 1 = 4 cos^2(angle / 2), so both ends are exact.
    """
    u, v = np.asarray(predicted, dtype=np.float64), np.asarray(true, dtype=np.float64)
    sine = np.linalg.norm(u - v, axis=(-2, -1)) / np.sqrt(8.0)
    cosine = np.sqrt(np.maximum((u * v).sum(axis=(-2, -1)) + 1.0, 0.0)) / 2.0
    return np.rad2deg(2 * np.arctan2(sine, cosine))

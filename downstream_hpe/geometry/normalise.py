# SPDX-License-Identifier: MIT
"""Landmarks without position and size, so that only shape and pose are left."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from downstream_hpe.geometry.face_mesh import LEFT_EYE, NOSE_TIP, POINTS, RIGHT_EYE

Normalisation = Literal["rms", "eyes"]
"""rms: the paper's Eq. landmark_normalization. eyes: what its published code does."""

NORMALISATIONS: tuple[Normalisation, ...] = get_args(Normalisation)


def normalise(landmarks: np.ndarray, how: Normalisation = "rms") -> np.ndarray:
    """Landmarks centred and scaled; the scale is rotation-invariant either way.

    rms:  x_i <- (x_i - c) / sqrt(mean_i |x_i - c|^2),  c = mean_i x_i
    eyes: x_i <- (x_i - x_1) / |x_33 - x_263|

    Parameters
    ----------
    landmarks: float [..., 468, 3], any unit. NaN stays NaN; of a face with such points c and the mean are of
    the others.

    Returns
    -------
    The same shape and floating type.

    Raises
    ------
    ValueError: an unknown name, another shape, or points that all coincide.
    """
    if landmarks.shape[-2:] != (POINTS, 3):
        raise ValueError(f"expected landmarks of shape [..., {POINTS}, 3], got {landmarks.shape}")
    if how == "rms":
        centred = landmarks - _mean_of_seen(landmarks)
        scale = np.sqrt(_mean_of_seen((centred**2).sum(axis=-1, keepdims=True)))
    elif how == "eyes":
        centred = landmarks - landmarks[..., NOSE_TIP : NOSE_TIP + 1, :]
        eyes = landmarks[..., RIGHT_EYE, :] - landmarks[..., LEFT_EYE, :]
        scale = np.linalg.norm(eyes, axis=-1)[..., None, None]
    else:
        raise ValueError(f"normalisation {how!r}: expected one of {', '.join(NORMALISATIONS)}")
    if (scale == 0).any():
        raise ValueError("cannot normalise landmarks that all coincide")
    return centred / scale


def _mean_of_seen(values: np.ndarray) -> np.ndarray:
    """Over the points, float [..., P, K] -> [..., 1, K]; NaN where there is none."""
    seen = ~np.isnan(values)
    if seen.all():
        return np.asarray(values.mean(axis=-2, keepdims=True))
    with np.errstate(invalid="ignore"):
        return np.asarray(
            np.where(seen, values, 0).sum(axis=-2, keepdims=True)
            / seen.sum(axis=-2, keepdims=True).astype(values.dtype)
        )

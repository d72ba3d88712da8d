# SPDX-License-Identifier: GPL-3.0-or-later
"""The mean face that landmarks are fitted to, to read a pose off them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from generator.geometry.rigid import Similarity, fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.landmarks.detector import POINTS


@cache
def reference_face() -> np.ndarray:
    """Mean of what Face Mesh finds on 24 neutral parametric heads, made symmetric.

    The mediapipe wheel does not carry the geometry of its canonical face, so we
    measure our own: ``scripts/make_reference_face.py`` rebuilds the file.

    Returns
    -------
    float64 [468, 3], mm, frame U, centroid at the origin, read-only. Its pose
    zero is that of the parametric heads.
    """
    text = files("generator.landmarks").joinpath("reference_face.csv").read_text(encoding="ascii")
    points = np.loadtxt(text.splitlines(), delimiter=",", comments="#")
    if points.shape != (POINTS, 3):
        raise ValueError(f"reference_face.csv: expected {POINTS} rows of x,y,z, got {points.shape}")
    points.setflags(write=False)
    return points


def fit_pose(landmarks: np.ndarray) -> Similarity:
    """Rigid fit of the reference face to landmarks: its rotation estimates R_C.

    Parameters
    ----------
    landmarks: float [468, 3], frame C, any unit (the scale of the fit is free).
    """
    return fit_similarity(reference_face() @ CAMERA_FROM_GRAPHICS, landmarks)

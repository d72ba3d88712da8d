# SPDX-License-Identifier: GPL-3.0-or-later
"""The mean faces that landmarks are fitted to, to read a pose off them."""

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

    For the detector's landmarks, whose depth is the detector's own idea. The mediapipe
    wheel does not carry the geometry of its canonical face, so we measure our own:
    ``scripts/make_reference_face.py`` rebuilds the file.

    Returns
    -------
    float64 [468, 3], mm, frame U, centroid at the origin, read-only. Its pose
    zero is the canonical one, of MediaPipe's canonical face model; see docs/conventions.md.
    """
    return _read("reference_face.csv")


@cache
def surface_face() -> np.ndarray:
    """Mean of where those points lie on the surface of the same heads, as :func:`reference_face`.

    For anchors, which have the true depth.
    """
    return _read("surface_face.csv")


def _read(name: str) -> np.ndarray:
    text = files("generator.landmarks").joinpath(name).read_text(encoding="ascii")
    points = np.loadtxt(text.splitlines(), delimiter=",", comments="#")
    if points.shape != (POINTS, 3):
        raise ValueError(f"{name}: expected {POINTS} rows of x,y,z, got {points.shape}")
    points.setflags(write=False)
    return points


def fit_pose(landmarks: np.ndarray) -> Similarity:
    """Rigid fit of the reference face to landmarks: its rotation estimates R_C.

    Parameters
    ----------
    landmarks: float [468, 3], frame C, any unit (the scale of the fit is free).
    """
    return fit_similarity(reference_face() @ CAMERA_FROM_GRAPHICS, landmarks)


@cache
def mirror_pairs() -> np.ndarray:
    """Index of each point's mirror partner, int [468]; points of the middle are their own."""
    face = reference_face()
    mirrored = face * [-1.0, 1.0, 1.0]
    pairs = np.linalg.norm(mirrored[:, None] - face[None], axis=2).argmin(axis=1)
    if (pairs[pairs] != np.arange(POINTS)).any():
        raise ValueError("reference_face.csv: its points cannot be paired; make it again")
    pairs.setflags(write=False)
    return pairs

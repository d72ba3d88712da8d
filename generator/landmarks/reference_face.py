# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose that landmarks tell by themselves."""

from __future__ import annotations

import numpy as np

from generator.geometry.rigid import Similarity, fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.landmarks.topology import FACE_MESH, Topology


def fit_pose(landmarks: np.ndarray, topology: Topology = FACE_MESH) -> Similarity:
    """Rigid fit of the reference face to landmarks: its rotation estimates R_C.

    Parameters
    ----------
    landmarks: float [P, 3], frame C, any unit (the scale of the fit is free).
    topology: what the P points are.
    """
    return fit_similarity(topology.reference_face() @ CAMERA_FROM_GRAPHICS, landmarks)

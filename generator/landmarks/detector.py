# SPDX-License-Identifier: GPL-3.0-or-later
"""What a landmark detector is, so that another can take MediaPipe Face Mesh's place."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from generator import registries
from generator.plan.settings import Landmarks

TOPOLOGY = "mediapipe-face-mesh-468"
POINTS = 468

RIGHT_EYE_OUTER, LEFT_EYE_OUTER = 33, 263
"""Outer eye corners of the subject's right (image left) and left eye."""

CHIN, NOSE_TIP = 152, 1


class Detector(Protocol):
    """Finds the 468 points of MediaPipe Face Mesh, in its order."""

    name: str
    """Name and version, for the dataset's metadata."""

    def detect(self, image: np.ndarray) -> np.ndarray | None:
        """Landmarks of the one face in an image.

        Parameters
        ----------
        image: uint8 [H, W, 3], RGB.

        Returns
        -------
        float32 [468, 3] in isotropic pixels of frame C, (x W, y H, z W) of the
        normalised output; or None if no face was found.
        """
        ...

    def close(self) -> None:
        """Free the model."""
        ...


def open_detector(landmarks: Landmarks) -> Detector:
    """The detector of some settings. Raises UsageError: an unknown name. WorkerError: it cannot start."""
    detector: Detector = registries.DETECTORS.get(landmarks.detector)(landmarks.min_confidence)
    return detector

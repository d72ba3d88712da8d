# SPDX-License-Identifier: GPL-3.0-or-later
"""What a landmark detector is, so that another can take MediaPipe Face Mesh's place."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from generator import registries
from generator.landmarks.topology import Topology
from generator.plan.settings import Landmarks


class Detector(Protocol):
    """Finds the points of one topology, in its order."""

    name: str
    """Name and version, for the dataset's metadata."""

    topology: Topology
    """What the points are; P = topology.count."""

    def detect(self, image: np.ndarray) -> np.ndarray | None:
        """Landmarks of the one face in an image.

        Parameters
        ----------
        image: uint8 [H, W, 3], RGB.

        Returns
        -------
        float32 [P, 3] in isotropic pixels of frame C, such as Face Mesh's (x W, y H, z W) of
        the normalised output; or None if no face was found.
        """
        ...

    def close(self) -> None:
        """Free the model."""
        ...


def open_detector(landmarks: Landmarks) -> Detector:
    """The detector of some settings. UsageError: an unknown name. WorkerError: it cannot start."""
    detector: Detector = registries.DETECTORS.get(landmarks.detector)(landmarks.min_confidence)
    return detector

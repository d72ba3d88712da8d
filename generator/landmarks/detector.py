# SPDX-License-Identifier: GPL-3.0-or-later
"""What a landmark detector is, so that another can take MediaPipe Face Mesh's place."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from generator import registries
from generator.errors import UsageError
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
    kind = registries.DETECTORS.get(landmarks.detector)
    detector: Detector = kind.of(landmarks) if hasattr(kind, "of") else kind(landmarks.min_confidence)
    return detector


def each_detector(landmarks: Landmarks) -> dict[str, Landmarks]:
    """The settings of every detector that looks at the images, by its name; that of the columns "detected"
    and "landmarks" first."""
    names = (landmarks.detector, *landmarks.also)
    return {name: replace(landmarks, detector=name, also=()) for name in names}


def check_detectors(landmarks: Landmarks) -> None:
    """UsageError: one is named twice, one finds other points, or a file is missing or not used."""
    names = [landmarks.detector, *landmarks.also]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise UsageError(f"--detector {','.join(names)}: {twice} is named twice")
    found = {name: registries.DETECTORS.get(name).topology.name for name in names}
    if other := next((name for name in names if found[name] != found[names[0]]), None):
        raise UsageError(
            f"--detector {','.join(names)}: {other} finds {found[other]}, and {names[0]} {found[names[0]]}; "
            "all have to find the same points"
        )
    if (landmarks.file is None) is ("file" in names):
        raise UsageError("--detector file and --detector-file PATH go together")

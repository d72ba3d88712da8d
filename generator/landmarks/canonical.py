# SPDX-License-Identifier: GPL-3.0-or-later
"""MediaPipe's canonical face and the rigid fit of landmarks to it."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from generator.errors import WorkerError
from generator.geometry.rigid import Similarity, fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.landmarks.detector import POINTS

_METADATA = "modules/face_geometry/data/geometry_pipeline_metadata_landmarks.binarypb"


@cache
def canonical_face() -> np.ndarray:
    """The canonical face model of the mediapipe wheel.

    Returns
    -------
    float64 [468, 3], mm, frame U (y up, z towards the viewer), read-only.
    """
    spec = find_spec("mediapipe")
    if spec is None or not spec.submodule_search_locations:
        raise WorkerError("mediapipe is not installed: pip install 'headturn[build]'")
    from mediapipe.modules.face_geometry.protos import geometry_pipeline_metadata_pb2 as protos

    metadata = protos.GeometryPipelineMetadata()
    metadata.ParseFromString((Path(spec.submodule_search_locations[0]) / _METADATA).read_bytes())
    # Each vertex is x y z u v.
    vertices = np.array(metadata.canonical_mesh.vertex_buffer, dtype=np.float64).reshape(-1, 5)
    points = vertices[:POINTS, :3] * 10.0
    points.setflags(write=False)
    return points


def fit_pose(landmarks: np.ndarray) -> Similarity:
    """Rigid fit of the canonical face to landmarks: its rotation is R_C.

    Parameters
    ----------
    landmarks: float [468, 3], frame C, any unit (the weak-perspective scale is free).
    """
    return fit_similarity(canonical_face() @ CAMERA_FROM_GRAPHICS, landmarks)

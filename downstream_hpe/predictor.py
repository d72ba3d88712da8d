# SPDX-License-Identifier: MIT
"""A trained model at work: landmarks or a picture in, head pose out. Needs onnxruntime only."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.normalise import POINTS

MODEL_FILE = "model.onnx"
FORMAT = "downstream-hpe 1"


@dataclass(frozen=True)
class Pose:
    """ypr_deg float32 [N, 3], (yaw, pitch, roll); rotation float32 [N, 3, 3], R_C."""

    ypr_deg: np.ndarray
    rotation: np.ndarray


class Predictor:
    """Open one with :meth:`load`.

    range_deg: float [3, 2], the angles the model was trained on; beyond them it extrapolates.
    """

    def __init__(self, session: Any, range_deg: np.ndarray) -> None:
        self._session = session
        self._detector: Any = None
        self.range_deg = range_deg

    @staticmethod
    def load(path: Path | str, *, threads: int = 1) -> Predictor:
        """path: a model folder of `downstream-hpe fit`, or an exported .onnx file.

        Raises
        ------
        ModelError: nothing there, not an ONNX file, or not one that `downstream-hpe export` wrote.
        """
        file = Path(path)
        if file.is_dir():
            file = file / MODEL_FILE
        if not file.is_file():
            raise ModelError(
                f"{file}: no such model; expected a folder of downstream-hpe fit or an .onnx file"
            )
        try:
            import onnxruntime as ort
            from onnxruntime.capi import onnxruntime_pybind11_state as faults
        except ImportError as error:
            raise ModelError("onnxruntime is not installed: pip install 'headturn[hpe]'") from error
        options = ort.SessionOptions()
        options.intra_op_num_threads = threads
        broken = (faults.InvalidProtobuf, faults.InvalidGraph, faults.Fail, faults.InvalidArgument)
        try:
            session = ort.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
        except broken as error:
            raise ModelError(f"{file}: not a readable ONNX model ({str(error).splitlines()[0]})") from error
        text = session.get_modelmeta().custom_metadata_map.get("downstream-hpe", "{}")
        try:
            facts = json.loads(text)
            ranges = np.array(facts["range_deg"], dtype=np.float64)
        except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
            raise ModelError(
                f"{file}: no downstream-hpe metadata; export it with downstream-hpe export"
            ) from error
        names = {value.name for value in session.get_outputs()}
        if facts.get("format") != FORMAT or ranges.shape != (3, 2) or not {"ypr_deg", "rotation"} <= names:
            raise ModelError(f"{file}: format {facts.get('format')!r}, expected {FORMAT!r}")
        return Predictor(session, ranges)

    def from_landmarks(self, landmarks: np.ndarray) -> Pose:
        """Pose of faces given by their landmarks.

        landmarks: float [N, 468, 3], MediaPipe's order, isotropic (x, y, z in one unit, such as
        x * width, y * height, z * width of MediaPipe's output), frame C.

        Raises
        ------
        DataError: another shape, or landmarks that are not finite.
        """
        points = np.asarray(landmarks, dtype=np.float32)
        if points.ndim != 3 or points.shape[1:] != (POINTS, 3):
            raise DataError(f"expected landmarks of shape [N, {POINTS}, 3], got {points.shape}")
        if not np.isfinite(points).all():
            raise DataError("landmarks are not finite; leave out faces that were not detected")
        if not len(points):
            return Pose(np.empty((0, 3), dtype=np.float32), np.empty((0, 3, 3), dtype=np.float32))
        ypr, rotation = self._session.run(["ypr_deg", "rotation"], {"landmarks": points})
        return Pose(ypr, rotation)

    def from_image(self, bgr: np.ndarray) -> Pose | None:
        """Pose of the most prominent face of a picture (N = 1), or None where no face is found.

        bgr: uint8 [H, W, 3]. Needs mediapipe, which is opened on the first call.
        """
        points = self.landmarks(bgr)
        return None if points is None else self.from_landmarks(points[None])

    def landmarks(self, bgr: np.ndarray) -> np.ndarray | None:
        """float64 [468, 3] of the most prominent face, isotropic pixels, frame C; None: no face."""
        if self._detector is None:
            self._detector = _face_mesh()
        if bgr.ndim != 3 or bgr.shape[2] != 3 or bgr.dtype != np.uint8:
            raise DataError(f"expected a uint8 picture [H, W, 3], got {bgr.dtype} {bgr.shape}")
        found = self._detector.process(np.ascontiguousarray(bgr[..., ::-1])).multi_face_landmarks
        if not found:
            return None
        height, width = bgr.shape[:2]
        points = np.array([(p.x, p.y, p.z) for p in found[0].landmark[:POINTS]])
        return points * np.array([width, height, width])

    def close(self) -> None:
        """Free the face detector, if one was opened."""
        if self._detector is not None:
            self._detector.close()
            self._detector = None


def _face_mesh() -> Any:
    try:
        from mediapipe.python.solutions.face_mesh import FaceMesh
    except ImportError as error:
        raise ModelError("mediapipe is not installed: pip install mediapipe==0.10.21") from error
    return FaceMesh(
        static_image_mode=True, max_num_faces=1, refine_landmarks=False, min_detection_confidence=0.5
    )

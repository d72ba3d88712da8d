# SPDX-License-Identifier: MIT
"""A trained model at work: landmarks or a picture in, head pose out. Needs onnxruntime only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.geometry.camera import Camera
from downstream_hpe.geometry.face_mesh import POINTS, WITH_IRISES
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.prediction import onnx_file
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.onnx_file import FORMAT, SHAPES
from downstream_hpe.prediction.onnx_shapes import BATCH
from downstream_hpe.prediction.plausibility import FaceShapes, quarter_turns
from downstream_hpe.prediction.six_degrees import place, undone
from downstream_hpe.reading import parse_json, read_limited

MODEL_FILE = "model.onnx"
DEFAULT_MODEL = "headturn"
EXPORT_AGAIN = "export it again with downstream-hpe export"
MODELS = Path(__file__).parents[1] / "models"
"""The models that come with the package, by name."""


@dataclass(frozen=True)
class Pose:
    """ypr_deg float32 [N, 3], (yaw, pitch, roll), and rotation float32 [N, 3, 3], R_C: as seen towards the
    face. confidence float32 [N], 0 to 1, or None where the model gives none.

    With a camera, else None: axis_ypr_deg float64 [N, 3] and axis_rotation float64 [N, 3, 3], relative to
    the optical axis; translation_mm float64 [N, 3], of the pivot between the ears, frame C, in the scale of
    the mean head. NaN where no place before the camera fits the landmarks.
    """

    ypr_deg: np.ndarray
    rotation: np.ndarray
    confidence: np.ndarray | None = None
    axis_ypr_deg: np.ndarray | None = None
    axis_rotation: np.ndarray | None = None
    translation_mm: np.ndarray | None = None


class Predictor:
    """Open one with :meth:`load`.

    range_deg: float [3, 2], the angles the model was trained on; beyond them it extrapolates.
    trained_subjects: whom it has seen, so that nobody measures it on them.
    pose_zero: "source", "level" or "canonical", as the data it learned from; None: not known.
    """

    def __init__(
        self,
        session: Any,
        range_deg: np.ndarray,
        trained_subjects: frozenset[str],
        pose_zero: str | None,
        name: str,
        detector: str | None = None,
    ) -> None:
        self._session = session
        self._name = name
        self._outputs = [value.name for value in session.get_outputs() if value.name in SHAPES]
        self._detector = FaceDetector(detector)
        self.range_deg = range_deg
        self.trained_subjects = trained_subjects
        self.pose_zero = pose_zero

    @staticmethod
    def load(
        model: Path | str = DEFAULT_MODEL, *, threads: int = 1, detector: str | None = None
    ) -> Predictor:
        """model: the name of a model that comes with the package, a model folder of `downstream-hpe fit`,
        or an exported .onnx file.

        detector: who finds faces in pictures, see
        :func:`downstream_hpe.prediction.landmarkers.open_landmarker`.
        The model may come from anywhere: it is read as numbers and arithmetic only, see
        :mod:`downstream_hpe.prediction.onnx_file`.

        Raises
        ------
        ModelError: nothing there, not an ONNX file, or not one that `downstream-hpe export` wrote.
        UsageError: no such detector.
        """
        file = _file_of(model)
        try:
            content = read_limited(file, onnx_file.MAX_BYTES)
        except ValueError as error:
            raise ModelError(
                f"{file}: larger than {onnx_file.MAX_BYTES / 1e6:.0f} MB; no model of this program"
            ) from error
        except OSError as error:
            raise ModelError(f"{file}: cannot be read ({error.strerror})") from error
        session = _open(file, content, threads)
        try:
            # What it calls a text need not be one.
            text = session.get_modelmeta().custom_metadata_map.get("downstream-hpe", "{}")
            values = [(v.name, v.type, v.shape[1:]) for v in (*session.get_inputs(), *session.get_outputs())]
            facts = parse_json(text)
            ranges = np.array(facts["range_deg"], dtype=np.float64)
            subjects = frozenset(map(str, facts["trained_subjects"]))
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"{file}: no downstream-hpe metadata; {EXPORT_AGAIN}") from error
        if facts.get("format") != FORMAT:
            raise ModelError(f"{file}: format {facts.get('format')!r}, expected {FORMAT!r}")
        if ranges.shape != (3, 2) or not (ranges[:, 0] < ranges[:, 1]).all():
            raise ModelError(f"{file}: its trained range is no range of three angles; {EXPORT_AGAIN}")
        found = {name: (kind, shape) for name, kind, shape in values}
        for name, shape in SHAPES.items():
            optional = name == "confidence" and name not in found
            if not optional and found.get(name) != ("tensor(float)", shape):
                raise ModelError(f"{file}: {name} is not float [N{''.join(f', {n}' for n in shape)}]")
        return Predictor(session, ranges, subjects, facts.get("pose_zero"), str(file), detector)

    def in_range(self, ypr_deg: np.ndarray) -> Any:
        """Whether all three angles are among those the model was trained on: float [..., 3] -> bool [...]."""
        low, high = self.range_deg.T
        return ((ypr_deg >= low) & (ypr_deg <= high)).all(axis=-1)

    def from_landmarks(self, landmarks: np.ndarray, camera: Camera | None = None) -> Pose:
        """Pose of faces given by their landmarks.

        landmarks: float [N, 468, 3] or, with those of the irises, which are left out, [N, 478, 3];
        MediaPipe's order, isotropic (x, y, z in one unit, such as x * width, y * height, z * width of
        MediaPipe's output), frame C; with a camera in its pixels.
        camera: gives translations and angles relative to the optical axis. Where it is not guessed, the
        perspective of the picture's edge is undone before the model sees the face.

        Raises
        ------
        DataError: another shape, or landmarks that are not finite.
        """
        points = np.asarray(landmarks)
        if points.ndim != 3 or points.shape[1:] not in ((POINTS, 3), (WITH_IRISES, 3)):
            raise DataError(
                f"expected landmarks of shape [N, {POINTS}, 3] or [N, {WITH_IRISES}, 3], got {points.shape}"
            )
        pose = self._seen(points[:, :POINTS])
        if camera is None:
            return pose
        points = points[:, :POINTS].astype(np.float64)
        if not camera.guessed:
            pose = self._seen(undone(points, pose.rotation, camera))
        rotation, translation_mm = place(points, pose.rotation.astype(np.float64), camera)
        return replace(
            pose,
            axis_ypr_deg=angles_from_rotation(rotation),
            axis_rotation=rotation,
            translation_mm=translation_mm,
        )

    def _seen(self, landmarks: np.ndarray) -> Pose:
        points = np.ascontiguousarray(landmarks, dtype=np.float32)
        if not np.isfinite(points).all():
            raise DataError("landmarks are not finite; leave out faces that were not detected")
        quarters = quarter_turns(points)
        if quarters.any():
            # The model knows upright faces alone.
            turns = rotation_from_angles(np.outer(90.0 * quarters, [0, 0, 1]))
            upright = self._upright((points @ turns).astype(np.float32))
            rotation = turns @ upright.rotation
            ypr_deg = np.where(quarters[:, None] == 0, upright.ypr_deg, angles_from_rotation(rotation))
            rotation = np.where(quarters[:, None, None] == 0, upright.rotation, rotation)
            return Pose(ypr_deg.astype(np.float32), rotation.astype(np.float32), upright.confidence)
        return self._upright(points)

    def _upright(self, points: np.ndarray) -> Pose:
        if not len(points):
            none = {name: np.empty((0, *SHAPES[name]), dtype=np.float32) for name in self._outputs}
            return _pose(none)
        batches = [self.graph(points[start : start + BATCH]) for start in range(0, len(points), BATCH)]
        found = {name: np.concatenate([batch[name] for batch in batches]) for name in self._outputs}
        if not all(np.isfinite(value).all() for value in found.values()):
            if (np.ptp(points, axis=1) == 0).all(axis=1).any():
                raise DataError(
                    "the landmarks of a face all coincide; leave out faces that were not detected"
                )
            raise ModelError(f"{self._name}: gives numbers that are not finite; {EXPORT_AGAIN}")
        if "confidence" in found:
            # The graph takes it that there is a face.
            found["confidence"] *= FaceShapes.load().share(points).astype(np.float32)
        return _pose(found)

    def graph(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """What the model alone says of upright faces, by the name of its output. points: float32 [N, 468, 3],
        N at most BATCH. ModelError: it fails."""
        try:
            values = self._session.run(self._outputs, {"landmarks": points})
        except _faults() as error:
            raise ModelError(
                f"{self._name}: fails on landmarks ({type(error).__name__}); {EXPORT_AGAIN}"
            ) from error
        if any(len(value) != len(points) for value in values):
            raise ModelError(f"{self._name}: gives another number of poses than of faces; {EXPORT_AGAIN}")
        return dict(zip(self._outputs, values, strict=True))

    def from_image(self, bgr: np.ndarray, faces: int = 1, camera: Camera | None = None) -> Pose | None:
        """Pose of the most prominent faces of a picture, at most so many; None where no face is found.

        bgr: uint8 [H, W, 3]. camera: as :meth:`from_landmarks`. The detector is opened on the first
        call.
        """
        points = self.faces(bgr, faces)
        return self.from_landmarks(points, camera) if len(points) else None

    def faces(self, bgr: np.ndarray, limit: int = 1, turned: bool = True) -> np.ndarray:
        """Landmarks of the most prominent faces, as :meth:`FaceDetector.faces` gives them."""
        return self._detector.faces(bgr, limit, turned)

    def close(self) -> None:
        """Free the face detector, if one was opened."""
        self._detector.close()


def shipped_models() -> list[str]:
    """Names of the models that come with the package."""
    return sorted(file.stem for file in MODELS.glob("*.onnx"))


def model_folder(model: Path | str) -> Path | None:
    """The folder of `downstream-hpe fit` that is meant; None for a model's name and for a single file."""
    # A path with a folder in it (./headturn) or a Path is never a name.
    named = isinstance(model, str) and model in shipped_models()
    return Path(model) if not named and Path(model).is_dir() else None


def _file_of(model: Path | str) -> Path:
    if isinstance(model, str) and model in shipped_models():
        return MODELS / f"{model}.onnx"
    folder = model_folder(model)
    file = Path(model) if folder is None else folder / MODEL_FILE
    if not file.exists():
        raise ModelError(
            f"{file}: no such model; expected a folder of downstream-hpe fit, an .onnx file, or one of the "
            f"models that come with this program: {', '.join(shipped_models()) or 'none'}"
        )
    return file


def _open(file: Path, content: bytes, threads: int) -> Any:
    try:
        import onnxruntime as ort
    except ImportError as error:
        raise ModelError("onnxruntime is not installed: pip install 'headturn[pose]'") from error
    reason = onnx_file.fault(content)
    if reason is not None:
        raise ModelError(f"{file}: not a readable ONNX model of this program ({reason})")
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4
    try:
        # Without the fallback, which prints the error, names of the file's and all, and fails again.
        return ort.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=False
        )
    except _faults() as error:
        # Its own text is long and speaks of its source files; the cause keeps it.
        reason = f"onnxruntime {ort.__version__} refuses it: {type(error).__name__}"
        opset, ir_version = onnx_file.versions(content)
        if opset > onnx_file.OPSET or ir_version > onnx_file.IR_VERSION:
            reason += f"; operator set {opset} or IR version {ir_version} may be too new for it"
        raise ModelError(f"{file}: not a readable ONNX model ({reason}); {EXPORT_AGAIN}") from error


def _faults() -> tuple[type[Exception], ...]:
    """What onnxruntime raises; its exceptions have no base of their own."""
    from onnxruntime.capi import onnxruntime_pybind11_state as faults

    theirs = [e for e in vars(faults).values() if isinstance(e, type) and issubclass(e, Exception)]
    return (*theirs, RuntimeError, MemoryError, UnicodeDecodeError)


def _pose(found: dict[str, np.ndarray]) -> Pose:
    return Pose(found["ypr_deg"], found["rotation"], found.get("confidence"))

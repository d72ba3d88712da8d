# SPDX-License-Identifier: MIT
"""A trained model at work: landmarks or a picture in, head pose out. Needs onnxruntime only."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, ModelError, UsageError
from downstream_hpe.geometry.camera import Camera
from downstream_hpe.geometry.face_mesh import POINTS, WITH_IRISES
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.partial import completed
from downstream_hpe.geometry.rotation import ANGLES, angles_from_rotation, rotation_from_angles
from downstream_hpe.prediction.crowd import Tile
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.given import Picture, rgb_of
from downstream_hpe.prediction.landmarkers import Place
from downstream_hpe.prediction.onnx_file import SHAPES
from downstream_hpe.prediction.onnx_shapes import BATCH
from downstream_hpe.prediction.plausibility import FaceShapes, quarter_turns
from downstream_hpe.prediction.points import points_seen
from downstream_hpe.prediction.pose import Pose
from downstream_hpe.prediction.pose_graph import EXPORT_AGAIN, PoseGraph
from downstream_hpe.prediction.six_degrees import place, undone

MODEL_FILE = "model.onnx"
DEFAULT_MODEL = "headturn"
MODELS = Path(__file__).parents[1] / "models"
"""The models that come with the package, by name."""


class Predictor:
    """A model, and a face detector that is opened for the first picture.

    >>> predictor = Predictor()
    >>> predictor
    <Predictor headturn: yaw -50 to 50, pitch -40 to 40, roll -30 to 30 degrees; faces by mediapipe>

    Any number of threads may share one, and get what one alone would. It can be pickled, as its arguments: a
    process that unpickles it opens model and detector anew. A process that was forked after a picture has to
    have another detector than mediapipe, and says so.

    range_deg: float [3, 2], the angles the model was trained on; beyond them it extrapolates.
    trained_subjects: whom it has seen, so that nobody measures it on them.
    pose_zero: "source", "level" or "canonical", as the data it learned from; None: not known.
    """

    def __init__(
        self,
        model: Path | str = DEFAULT_MODEL,
        *,
        threads: int = 1,
        detector: Path | str | None = None,
    ) -> None:
        """model: the name of a model that comes with the package, a model folder of `downstream-hpe fit`,
        or an exported .onnx file, which may come from anywhere.

        threads: of onnxruntime; one is quickest for a few faces at a time.
        detector: who finds faces in pictures, see
        :func:`downstream_hpe.prediction.landmarkers.landmarker_name`.

        Raises
        ------
        ModelError: nothing there, not an ONNX file, or not one that `downstream-hpe export` wrote.
        UsageError: no such detector.
        """
        file = model_file(model)
        self._graph = PoseGraph(file, threads)
        self._detector = FaceDetector(None if detector is None else str(detector))
        self._threads = threads
        # Of another process, whose current folder may be another one.
        self._model = model if file.parent == MODELS else Path(model).absolute()
        self.range_deg = self._graph.range_deg
        self.trained_subjects = self._graph.trained_subjects
        self.pose_zero = self._graph.pose_zero

    @staticmethod
    def load(
        model: Path | str = DEFAULT_MODEL, *, threads: int = 1, detector: Path | str | None = None
    ) -> Predictor:
        """The same as ``Predictor(model, ...)``."""
        return Predictor(model, threads=threads, detector=detector)

    def __repr__(self) -> str:
        ranges = zip(ANGLES, self.range_deg, strict=True)
        ends = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in ranges)
        return f"<Predictor {self._model}: {ends} degrees; faces by {self._detector.name}>"

    def __getstate__(self) -> dict[str, Any]:
        return {"model": self._model, "threads": self._threads, "detector": self._detector.name}

    def __setstate__(self, state: dict[str, Any]) -> None:
        Predictor.__init__(self, **state)

    def __enter__(self) -> Predictor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def in_range(self, ypr_deg: np.ndarray) -> Any:
        """Whether all three angles are among those the model was trained on: float [..., 3] -> bool [...]."""
        low, high = self.range_deg.T
        return ((ypr_deg >= low) & (ypr_deg <= high)).all(axis=-1)

    def predict(self, picture: Picture, faces: int = 1, camera: Camera | None = None) -> Pose | None:
        """Pose of the most prominent faces of a picture, at most so many; None where no face is found.

        picture: the path of one, a PIL.Image, or uint8 [H, W, 3], RGB; [H, W, 4] without its alpha, and
        grey [H, W]. Of OpenCV's arrays, BGR: :meth:`from_image`. camera: as :meth:`from_landmarks`.

        Raises
        ------
        DataError: no picture, or another array. ModelError: the detector is not installed.
        """
        return self._of_picture(rgb_of(picture), faces, camera)

    def from_image(self, bgr: Picture, faces: int = 1, camera: Camera | None = None) -> Pose | None:
        """As :meth:`predict`, of arrays in the order of OpenCV: uint8 [H, W, 3], BGR."""
        return self._of_picture(rgb_of(bgr, bgr=True), faces, camera)

    def _of_picture(self, rgb: np.ndarray, faces: int, camera: Camera | None) -> Pose | None:
        if isinstance(faces, bool) or not isinstance(faces, int | np.integer) or faces < 1:
            raise UsageError(f"faces: expected a number from 1 on, got {faces!r}")
        points = self.faces(rgb[..., ::-1], int(faces))
        return self.from_landmarks(points, camera) if len(points) else None

    def from_landmarks(self, landmarks: np.ndarray, camera: Camera | None = None) -> Pose:
        """Pose of faces given by their landmarks.

        landmarks: float [N, 468, 3] or, with those of the irises, which are left out, [N, 478, 3];
        MediaPipe's order, isotropic (x, y, z in one unit, such as x * width, y * height, z * width of
        MediaPipe's output), frame C; with a camera in its pixels. A partial face has NaN for points that are
        not seen, and at least 20 others; models of the continuous recipe take them.
        camera: gives translations and angles relative to the optical axis. Where it is not guessed, the
        perspective of the picture's edge is undone before the model sees the face.

        Raises
        ------
        DataError: another shape, infinite landmarks, or too few of a face. ModelError: partial faces, which
            this model does not take.
        """
        points = _checked(landmarks)
        seen = points_seen(points, None if self._graph.takes_partial else str(self._graph.file))
        if camera is not None and not isinstance(camera, Camera):
            raise UsageError(
                f"camera: expected a Camera, such as Camera.from_fov(60, width, height) or Camera(K), "
                f"got {type(camera).__name__}"
            )
        pose = self._seen(points)
        if camera is not None:
            exact = points.astype(np.float64)
            if not seen.all():
                exact = completed(exact, mean_head())
            if not camera.guessed:
                again = undone(exact, pose.rotation, camera)
                pose = self._seen(np.where(seen[..., None], again, np.nan))
            rotation, translation_mm = place(exact, pose.rotation.astype(np.float64), camera)
            pose = replace(
                pose,
                axis_ypr_deg=angles_from_rotation(rotation),
                axis_rotation=rotation,
                translation_mm=translation_mm,
            )
        return replace(pose, landmarks=points, in_range=self.in_range(pose.ypr_deg))

    def _seen(self, landmarks: np.ndarray) -> Pose:
        points = np.ascontiguousarray(landmarks, dtype=np.float32)
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
        outputs = self._graph.outputs
        if not len(points):
            none = {name: np.empty((0, *SHAPES[name]), dtype=np.float32) for name in outputs}
            return _pose(none)
        batches = [self.graph(points[start : start + BATCH]) for start in range(0, len(points), BATCH)]
        found = {name: np.concatenate([batch[name] for batch in batches]) for name in outputs}
        if not all(np.isfinite(value).all() for value in found.values()):
            if (np.nanmax(points, axis=1) == np.nanmin(points, axis=1)).all(axis=1).any():
                raise DataError(
                    "the landmarks of a face all coincide; leave out faces that were not detected"
                )
            raise ModelError(f"{self._graph.file}: gives numbers that are not finite; {EXPORT_AGAIN}")
        if "confidence" in found:
            # The graph takes it that there is a face.
            found["confidence"] *= FaceShapes.load().share(points).astype(np.float32)
        return _pose(found)

    def graph(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """What the model alone says of upright faces, by the name of its output. points: float32 [N, 468, 3],
        N at most BATCH. ModelError: it fails."""
        return self._graph(points)

    def faces(self, bgr: np.ndarray, limit: int = 1, turned: bool = True) -> np.ndarray:
        """Landmarks of the most prominent faces, as :meth:`FaceDetector.faces` gives them."""
        return self._detector.faces(bgr, limit, turned)

    def face_at(self, bgr: np.ndarray, place: Place) -> np.ndarray | None:
        """Landmarks of a face whose place was found otherwise, as :meth:`FaceDetector.at` gives them."""
        return self._detector.at(bgr, place)

    def faces_in_tile(self, bgr: np.ndarray, tile: Tile, before: list[np.ndarray]) -> list[np.ndarray]:
        """Landmarks of faces that were not seen before, as :meth:`FaceDetector.in_tile` gives them."""
        return self._detector.in_tile(bgr, tile, before)

    def blendshapes(self, picture: Picture, landmarks: np.ndarray) -> np.ndarray:
        """What faces do, by the names of :data:`litert_faces.blendshapes.NAMES`: float32 [N, 52], 0 to 1; NaN
        where a face is not seen again.

        Only of a Predictor whose detector is the path of a face_landmarker.task, which is to have found them.
        picture: as :meth:`predict`. landmarks: [N, 468, 3], of its pose, pixels of the picture.

        Raises
        ------
        DataError: no picture, or another shape. ModelError: another detector.
        """
        return self._detector.blendshapes(rgb_of(picture), _checked(landmarks))

    def close(self) -> None:
        """Free the face detector, if one was opened; another picture opens it anew."""
        self._detector.close()


def shipped_models() -> list[str]:
    """Names of the models that come with the package."""
    return sorted(file.stem for file in MODELS.glob("*.onnx"))


def model_folder(model: Path | str) -> Path | None:
    """The folder of `downstream-hpe fit` that is meant; None for a model's name and for a single file."""
    # A path with a folder in it (./headturn) or a Path is never a name.
    named = isinstance(model, str) and model in shipped_models()
    return Path(model) if not named and Path(model).is_dir() else None


def model_file(model: Path | str) -> Path:
    """The ONNX file of what :class:`Predictor` takes. ModelError: there is none."""
    if isinstance(model, str) and model in shipped_models():
        return MODELS / f"{model}.onnx"
    if not isinstance(model, str | os.PathLike):
        raise UsageError(f"model: expected a name or a path, got {type(model).__name__}")
    folder = model_folder(model)
    file = Path(model) if folder is None else folder / MODEL_FILE
    if not file.exists():
        raise ModelError(
            f"{file}: no such model; expected a folder of downstream-hpe fit, an .onnx file, or one of the "
            f"models that come with this program: {', '.join(shipped_models()) or 'none'}"
        )
    return file


def _checked(landmarks: np.ndarray) -> np.ndarray:
    """[N, 468, 3]; the array itself, or a view of it."""
    try:
        points = np.asarray(landmarks)
    except ValueError as error:  # lists of several lengths
        raise DataError(f"expected landmarks of shape [N, {POINTS}, 3], got lists of no one shape") from error
    if points.ndim != 3 or points.shape[1:] not in ((POINTS, 3), (WITH_IRISES, 3)):
        raise DataError(
            f"expected landmarks of shape [N, {POINTS}, 3] or [N, {WITH_IRISES}, 3], got {points.shape}"
        )
    if points.dtype.kind not in "fiu":
        raise DataError(f"expected landmarks as numbers, got {points.dtype}")
    return points[:, :POINTS]


def _pose(found: dict[str, np.ndarray]) -> Pose:
    return Pose(found["ypr_deg"], found["rotation"], found.get("confidence"))

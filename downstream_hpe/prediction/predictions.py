# SPDX-License-Identifier: MIT
"""What `downstream-hpe predict` does: pictures and videos in, one record a face out."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.camera import Camera
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.boxes import Boxes
from downstream_hpe.prediction.cameras import CameraOf, guessed_camera
from downstream_hpe.prediction.drawing import draw_faces
from downstream_hpe.prediction.face import Face, Placed
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.landmarkers import Place
from downstream_hpe.prediction.opened import Reader, open_picture, open_reader
from downstream_hpe.prediction.pictures import Picture, write_bgr
from downstream_hpe.prediction.pose import Pose
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.records import Record, record
from downstream_hpe.prediction.tracks import FaceTracks
from downstream_hpe.prediction.video_file import VideoWriter
from downstream_hpe.prediction.way_up import WayUp


@dataclass(frozen=True)
class Options:
    """faces: at most so many a picture or frame. smooth: one-euro filter on video, one a face. frames: of a
    video, at most so many. camera: of a picture, by its size. boxes: where faces are; None: they are looked
    for."""

    faces: int = 1
    smooth: bool = False
    frames: int | None = None
    camera: CameraOf = guessed_camera
    boxes: Boxes | None = None


def predictions(
    every: Sequence[Source],
    predictor: Predictor,
    options: Options = Options(),
    leave_out: Callable[[str], None] = lambda text: None,
) -> Generator[Record, None, None]:
    """A record a face, and one that says so for a picture or frame without any.

    leave_out: called with one line for what cannot be read, and where a video ends early.
    """
    for source in every:
        try:
            if source.moving:
                reader = open_reader(source)
                size = reader.size
            else:
                picture = open_picture(source)
                size = picture.size
            camera = options.camera(*size)
            places = None if options.boxes is None else options.boxes.places(Path(str(source.path)), size)
        except DataError as error:
            leave_out(str(error))
            continue
        tracks = FaceTracks(source.moving and options.smooth)
        look = _Look(predictor, camera, options.faces, tracks, WayUp() if source.moving else None)
        if source.moving:
            yield from _video(source, reader, look, options, places, leave_out)
        else:
            yield from _picture(source, picture, look, options, places, leave_out)


def _picture(
    source: Source,
    picture: Picture,
    look: _Look,
    options: Options,
    places: dict[int | None, list[Place]] | None,
    leave_out: Callable[[str], None],
) -> Iterator[Record]:
    try:
        if places is None:
            faces: list[Face | None] = [*look.faces(picture.bgr, 0.0, picture.reduced)]
        else:
            faces = look.at(picture.bgr, places.get(None, []), 0.0, picture.reduced)
    except DataError as error:
        # Such as one that is longer than a detector takes; the others of a folder are none the worse.
        leave_out(f"{source.name}: {error}")
        return
    if source.copy is not None:
        # Drawn into the picture as it was read, which may be smaller.
        seen = [replace(f, landmarks=f.landmarks / picture.reduced) for f in faces if f is not None]
        write_bgr(draw_faces(picture.bgr, seen, options.faces > 1 or places is not None), source.copy)
    for n, face in enumerate(faces):
        yield record(source.name, None, None, face, n)
    if not faces:
        yield record(source.name, None, None, None)


def _video(
    source: Source,
    reader: Reader,
    look: _Look,
    options: Options,
    places: dict[int | None, list[Place]] | None,
    leave_out: Callable[[str], None],
) -> Iterator[Record]:
    count = 0
    with contextlib.closing(reader), VideoWriter(source.copy) as writer:
        for image, time_s in islice(reader, options.frames):
            if places is None:
                faces: list[Face | None] = [*look.faces(image, time_s)]
            else:
                faces = look.at(image, places.pop(count, []), time_s)
            if source.copy is not None:
                seen = [face for face in faces if face is not None]
                writer.add(draw_faces(image, seen, options.faces > 1 or places is not None), time_s)
            for n, face in enumerate(faces):
                yield record(source.name, count, time_s, face, n)
            if not faces:
                yield record(source.name, count, time_s, None)
            count += 1
    if options.frames is None or count < options.frames:
        short = reader.shortfall()
        if short is not None:
            leave_out(short)
        if places:
            leave_out(f"{source.name}: has {count} frames, from 0 on, and boxes for {len(places)} others")


@dataclass(frozen=True)
class _Look:
    """What is done with each picture or frame of one source. way_up: None of a picture, which is looked at
    every way up."""

    predictor: Predictor
    camera: Camera
    limit: int
    tracks: FaceTracks
    way_up: WayUp | None

    def faces(self, image: np.ndarray, time_s: float, reduced: float = 1.0) -> list[Face]:
        """reduced: how many times smaller the image is than what the camera is of."""
        if self.way_up is None:
            found = self.predictor.faces(image, self.limit, True)
        else:
            found = self.way_up.faces(self.predictor, image, self.limit, time_s)
        found = found * reduced
        indices = self.tracks.indices(found, time_s)
        return sorted(self._posed(found, indices, time_s), key=lambda face: face.index)

    def at(
        self, image: np.ndarray, places: Sequence[Place], time_s: float, reduced: float = 1.0
    ) -> list[Face | None]:
        """A face a place, or None where none is there. Its index is the place's, whoever it was before."""
        looks = [self.predictor.face_at(image, (centre / reduced, size / reduced)) for centre, size in places]
        seen = [n for n, landmarks in enumerate(looks) if landmarks is not None]
        found = np.array([looks[n] for n in seen]).reshape(-1, POINTS, 3) * reduced
        posed = self._posed(found, self.tracks.indices(found, time_s), time_s)
        faces = {n: replace(face, index=n) for n, face in zip(seen, posed, strict=True)}
        return [faces.get(n) for n in range(len(places))]

    def _posed(self, found: np.ndarray, indices: Sequence[int], time_s: float) -> list[Face]:
        if not len(found):
            return []
        pose = self.predictor.from_landmarks(found, self.camera)
        faces = []
        for n, index in enumerate(indices):
            raw = pose.rotation[n].astype(np.float64)
            rotation = self.tracks.steady(index, raw, time_s)
            ypr_deg = angles_from_rotation(rotation)
            confidence = None if pose.confidence is None else float(pose.confidence[n])
            inside = bool(self.predictor.in_range(ypr_deg))
            placed = self._placed(pose, n, raw.T @ rotation)
            faces.append(Face(index, found[n], rotation, ypr_deg, confidence, inside, placed))
        return faces

    def _placed(self, pose: Pose, n: int, steadied: np.ndarray) -> Placed | None:
        """steadied: what the filter turned the head by, [3, 3]."""
        if pose.axis_rotation is None or pose.translation_mm is None:
            raise ValueError("a pose without its place")
        if not np.isfinite(pose.translation_mm[n]).all():
            return None
        ypr_deg = angles_from_rotation(pose.axis_rotation[n] @ steadied)
        return Placed(ypr_deg, pose.translation_mm[n], self.camera.focal_px, self.camera.guessed)

# SPDX-License-Identifier: MIT
"""What `downstream-hpe predict` does: pictures and videos in, one record a face out."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.camera import Camera
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.cameras import CameraOf, guessed_camera
from downstream_hpe.prediction.drawing import draw_faces
from downstream_hpe.prediction.face import Face, Placed
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.pictures import read_bgr, write_bgr
from downstream_hpe.prediction.predictor import Pose, Predictor
from downstream_hpe.prediction.records import Record, record
from downstream_hpe.prediction.tracks import FaceTracks
from downstream_hpe.prediction.video import VideoReader, VideoWriter
from downstream_hpe.prediction.way_up import WayUp


@dataclass(frozen=True)
class Options:
    """faces: at most so many a picture or frame. smooth: one-euro filter on video, one a face. frames: of a
    video, at most so many. camera: of a picture, by its size."""

    faces: int = 1
    smooth: bool = False
    frames: int | None = None
    camera: CameraOf = guessed_camera


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
                reader = VideoReader(source.path)
                camera = options.camera(*reader.size)
            else:
                image = read_bgr(Path(source.name))
                camera = options.camera(image.shape[1], image.shape[0])
        except DataError as error:
            leave_out(str(error))
            continue
        tracks = FaceTracks(source.moving and options.smooth)
        look = _Look(predictor, camera, options.faces, tracks, WayUp() if source.moving else None)
        if source.moving:
            yield from _video(source, reader, look, options, leave_out)
        else:
            yield from _picture(source, image, look, options)


def _picture(source: Source, image: np.ndarray, look: _Look, options: Options) -> Iterator[Record]:
    faces = look.faces(image, 0.0)
    if source.copy is not None:
        write_bgr(draw_faces(image, faces, options.faces > 1), source.copy)
    for face in faces or (None,):
        yield record(source.name, None, None, face)


def _video(
    source: Source,
    reader: VideoReader,
    look: _Look,
    options: Options,
    leave_out: Callable[[str], None],
) -> Iterator[Record]:
    count = 0
    with reader, VideoWriter(source.copy, reader.rate) as writer:
        began = time.monotonic()
        for image in islice(reader, options.frames):
            # A file has a rate; a webcam gives a frame whenever it is asked.
            live = isinstance(source.path, int)
            time_s = time.monotonic() - began if live else count / reader.rate
            faces = look.faces(image, time_s)
            if source.copy is not None:
                writer.add(draw_faces(image, faces, options.faces > 1))
            for face in faces or (None,):
                yield record(source.name, count, time_s, face)
            count += 1
    if reader.ended_early(count, options.frames):
        leave_out(f"{source.name}: ended after {count} of {reader.expected} frames; what there was is kept")


@dataclass(frozen=True)
class _Look:
    """What is done with each picture or frame of one source. way_up: None of a picture, which is looked at
    every way up."""

    predictor: Predictor
    camera: Camera
    limit: int
    tracks: FaceTracks
    way_up: WayUp | None

    def faces(self, image: np.ndarray, time_s: float) -> list[Face]:
        if self.way_up is None:
            found = self.predictor.faces(image, self.limit, True)
        else:
            found = self.way_up.faces(self.predictor, image, self.limit, time_s)
        if not len(found):
            self.tracks.indices(found, time_s)
            return []
        pose = self.predictor.from_landmarks(found, self.camera)
        faces = []
        for n, index in enumerate(self.tracks.indices(found, time_s)):
            raw = pose.rotation[n].astype(np.float64)
            rotation = self.tracks.steady(index, raw, time_s)
            ypr_deg = angles_from_rotation(rotation)
            confidence = None if pose.confidence is None else float(pose.confidence[n])
            inside = bool(self.predictor.in_range(ypr_deg))
            placed = self._placed(pose, n, raw.T @ rotation)
            faces.append(Face(index, found[n], rotation, ypr_deg, confidence, inside, placed))
        return sorted(faces, key=lambda face: face.index)

    def _placed(self, pose: Pose, n: int, steadied: np.ndarray) -> Placed | None:
        """steadied: what the filter turned the head by, [3, 3]."""
        if pose.axis_rotation is None or pose.translation_mm is None:
            raise ValueError("a pose without its place")
        if not np.isfinite(pose.translation_mm[n]).all():
            return None
        ypr_deg = angles_from_rotation(pose.axis_rotation[n] @ steadied)
        return Placed(ypr_deg, pose.translation_mm[n], self.camera.focal_px, self.camera.guessed)

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
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.drawing import draw_faces
from downstream_hpe.prediction.face import Face
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.pictures import read_bgr, write_bgr
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.records import Record, record
from downstream_hpe.prediction.tracks import FaceTracks
from downstream_hpe.prediction.video import VideoReader, VideoWriter


@dataclass(frozen=True)
class Options:
    """faces: at most so many a picture or frame. smooth: one-euro filter on video, one a face. frames: of a
    video, at most so many."""

    faces: int = 1
    smooth: bool = False
    frames: int | None = None


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
            else:
                image = read_bgr(Path(source.name))
        except DataError as error:
            leave_out(str(error))
            continue
        if source.moving:
            yield from _video(source, reader, predictor, options, leave_out)
        else:
            yield from _picture(source, image, predictor, options)


def _picture(source: Source, image: np.ndarray, predictor: Predictor, options: Options) -> Iterator[Record]:
    faces = _faces(image, predictor, options, FaceTracks(smooth=False), 0.0)
    if source.copy is not None:
        write_bgr(draw_faces(image, faces, options.faces > 1), source.copy)
    for face in faces or (None,):
        yield record(source.name, None, None, face)


def _video(
    source: Source,
    reader: VideoReader,
    predictor: Predictor,
    options: Options,
    leave_out: Callable[[str], None],
) -> Iterator[Record]:
    count = 0
    with reader, VideoWriter(source.copy, reader.rate) as writer:
        tracks = FaceTracks(options.smooth)
        began = time.monotonic()
        for image in islice(reader, options.frames):
            # A file has a rate; a webcam gives a frame whenever it is asked.
            live = isinstance(source.path, int)
            time_s = time.monotonic() - began if live else count / reader.rate
            faces = _faces(image, predictor, options, tracks, time_s)
            if source.copy is not None:
                writer.add(draw_faces(image, faces, options.faces > 1))
            for face in faces or (None,):
                yield record(source.name, count, time_s, face)
            count += 1
    if reader.ended_early(count, options.frames):
        leave_out(f"{source.name}: ended after {count} of {reader.expected} frames; what there was is kept")


def _faces(
    image: np.ndarray, predictor: Predictor, options: Options, tracks: FaceTracks, time_s: float
) -> list[Face]:
    found = predictor.faces(image, options.faces)
    if not len(found):
        tracks.indices(found, time_s)
        return []
    pose = predictor.from_landmarks(found)
    faces = []
    for n, index in enumerate(tracks.indices(found, time_s)):
        rotation = tracks.steady(index, pose.rotation[n].astype(np.float64), time_s)
        ypr_deg = angles_from_rotation(rotation)
        confidence = None if pose.confidence is None else float(pose.confidence[n])
        faces.append(Face(index, found[n], rotation, ypr_deg, confidence, bool(predictor.in_range(ypr_deg))))
    return sorted(faces, key=lambda face: face.index)

# SPDX-License-Identifier: MIT
"""What `downstream-hpe predict` does: inputs in, one record a picture or frame out."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import UsageError
from downstream_hpe.pictures import draw_axes, read_bgr, write_bgr
from downstream_hpe.predictor import Predictor
from downstream_hpe.rotation import angles_from_rotation
from downstream_hpe.smoothing import OneEuroFilter
from downstream_hpe.video import SUFFIXES, VideoReader, VideoWriter

PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".webp"}
COLUMNS = ("input", "frame", "time_s", "found", "yaw_deg", "pitch_deg", "roll_deg")

Record = dict[str, Any]


def sources(inputs: Sequence[str]) -> list[Path | int]:
    """Pictures, videos and webcams: a folder stands for the pictures and videos in it, webcam:N for a number.

    Raises
    ------
    UsageError: something that is not there, or a folder with nothing to read.
    """
    found: list[Path | int] = []
    for text in inputs:
        kind, _, number = text.partition(":")
        path = Path(text)
        if kind == "webcam":
            if not number.isdigit():
                raise UsageError(f"{text}: expected a number, such as webcam:0")
            found.append(int(number))
        elif path.is_dir():
            inside = sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES | SUFFIXES)
            if not inside:
                raise UsageError(f"{path}: no picture or video in it")
            found += inside
        elif path.is_file():
            found.append(path)
        else:
            raise UsageError(f"{path}: there is no such picture, video or folder")
    return found


def predictions(
    every: Sequence[Path | int],
    predictor: Predictor,
    drawn: Path | None = None,
    *,
    smooth: bool = False,
    frames: int | None = None,
) -> Iterator[Record]:
    """A record (COLUMNS) a picture or frame; angles are None where no face is found.

    drawn: folder for copies with the axes drawn. smooth: one-euro filter on video, started afresh
    after frames without a face. frames: of a video, at most so many.
    """
    if drawn is not None:
        drawn.mkdir(parents=True, exist_ok=True)
    for source in every:
        if isinstance(source, Path) and source.suffix.lower() not in SUFFIXES:
            image = read_bgr(source)
            rotation, copy = _pose(image, predictor, drawn is not None, None, 0.0)
            if drawn is not None:
                write_bgr(copy, drawn / f"{source.stem}.png")
            yield _record(str(source), None, None, rotation)
        else:
            yield from _video(source, predictor, drawn, smooth, frames)


def _video(
    source: Path | int, predictor: Predictor, drawn: Path | None, smooth: bool, frames: int | None
) -> Iterator[Record]:
    name = f"webcam:{source}" if isinstance(source, int) else str(source)
    stem = f"webcam{source}" if isinstance(source, int) else source.stem
    with VideoReader(source) as reader, VideoWriter((drawn or Path()) / f"{stem}.mp4", reader.rate) as writer:
        steady = OneEuroFilter() if smooth else None
        began = time.monotonic()
        for number, image in enumerate(islice(reader, frames)):
            # A file has a rate; a webcam gives a frame whenever it is asked.
            time_s = time.monotonic() - began if isinstance(source, int) else number / reader.rate
            rotation, copy = _pose(image, predictor, drawn is not None, steady, time_s)
            if rotation is None and smooth:
                steady = OneEuroFilter()
            if drawn is not None:
                writer.add(copy)
            yield _record(name, number, time_s, rotation)


def _pose(
    image: np.ndarray, predictor: Predictor, draw: bool, steady: OneEuroFilter | None, time_s: float
) -> tuple[np.ndarray | None, np.ndarray]:
    """R_C of the face, or None, and the picture, with axes where asked for."""
    points = predictor.landmarks(image)
    if points is None:
        return None, image
    rotation = predictor.from_landmarks(points[None]).rotation[0].astype(np.float64)
    if steady is not None:
        rotation = steady(rotation, time_s)
    return rotation, draw_axes(image, points, rotation) if draw else image


def _record(name: str, frame: int | None, time_s: float | None, rotation: np.ndarray | None) -> Record:
    angles = [None] * 3 if rotation is None else np.round(angles_from_rotation(rotation), 3).tolist()
    return dict(zip(COLUMNS, (name, frame, time_s, rotation is not None, *angles), strict=True))

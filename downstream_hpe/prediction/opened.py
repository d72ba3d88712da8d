# SPDX-License-Identifier: MIT
"""Sources, opened: a picture, or something that gives frame after frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from downstream_hpe.prediction.animation import Animation
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.kinds import Kind
from downstream_hpe.prediction.pictures import File, Picture, read_picture
from downstream_hpe.prediction.piped import STDIN, fetched, piped_picture, piped_video
from downstream_hpe.prediction.video import Frame, VideoReader
from downstream_hpe.prediction.webcam import Webcam


class Reader(Protocol):
    """Frames of a video, a webcam or an animation; to be closed. size: width and height, pixels."""

    size: tuple[int, int]

    def __iter__(self) -> Iterator[Frame]:
        """Each frame, and its time, which rises."""
        ...

    def shortfall(self) -> str | None:
        """One line, once all frames were asked for, where fewer came than there should be; else None."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


def open_picture(source: Source) -> Picture:
    """The picture of a source that does not move. DataError: it cannot be read."""
    return read_picture(_file(source), source.name)


def open_reader(source: Source) -> Reader:
    """The frames of a source that moves. DataError: it cannot be read."""
    if isinstance(source.path, int):
        return Webcam(source.path)
    if source.kind is Kind.ANIMATION:
        return Animation(_file(source), source.name)
    return VideoReader(piped_video() if source.path == STDIN else source.path, source.name)


def _file(source: Source) -> File:
    if source.path == STDIN:
        return piped_picture()
    if isinstance(source.path, str):
        return fetched(source.path, source.name)
    return Path(str(source.path))

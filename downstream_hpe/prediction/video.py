# SPDX-License-Identifier: MIT
"""Video files and webcams, frame by frame."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from downstream_hpe.errors import INSTALL, DataError, ModelError
from downstream_hpe.reading import check_regular

SUFFIXES = {".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv"}
MAX_BYTES = 1 << 40
MAX_PIXELS = 1 << 26
"""Of a frame: 8192 x 8192."""
_BEGINNINGS = (
    (4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"free"), (4, b"skip"), (4, b"wide"), (4, b"pnot"),
    (0, b"\x1a\x45\xdf\xa3"), (8, b"AVI "), (0, b"\x30\x26\xb2\x75"),
    (0, b"\0\0\x01\xba"), (0, b"\0\0\x01\xb3"), (0, b"\x47"),
)  # fmt: skip
"""(place, bytes) of what these suffixes hold: QuickTime and MP4, Matroska, AVI, ASF, MPEG. FFmpeg goes by
what it finds: elsewhere that may be a list of other files, or of addresses."""
FALLBACK_RATE = 30.0
"""Frames a second, where a camera or file does not say."""


class VideoReader:
    """Frames of a file (its path) or a webcam (its number, from 0). Use it as a context manager.

    rate: frames a second. size: width and height of a frame, pixels. expected: how many frames a file says
    it has, 0 where it does not.

    Raises
    ------
    DataError: it cannot be opened. ModelError: OpenCV is missing.
    """

    def __init__(self, source: Path | int) -> None:
        cv2 = _opencv()
        if isinstance(source, int):
            self._capture = cv2.VideoCapture(source)
        else:
            _check_file(source)
            # No other backend: one takes a name for a pattern, or for a program to run.
            self._capture = cv2.VideoCapture(str(source), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            if isinstance(source, int):
                raise DataError(f"webcam:{source}: there is no such webcam, or another program uses it")
            raise DataError(f"{source}: cannot be opened as video; it is cut off or none")
        size = [int(self._capture.get(k)) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
        if size[0] * size[1] > MAX_PIXELS:
            self._capture.release()
            raise DataError(f"{source}: frames of {size[0]} x {size[1]} pixels; make them smaller")
        self.size = (int(size[0]), int(size[1]))
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.rate = rate if np.isfinite(rate) and rate > 0 else FALLBACK_RATE
        self.expected = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)))

    def ended_early(self, count: int, limit: int | None = None) -> bool:
        """Whether the file promised more than count frames, beyond the error of such promises.

        limit: so many were asked for; None: all.
        """
        return count < (limit or self.expected) and count < 0.95 * self.expected - 1

    def __iter__(self) -> Iterator[np.ndarray]:
        """uint8 [H, W, 3], BGR. Ends with the last whole frame, also of a file that was cut off."""
        while True:
            whole, frame = self._capture.read()
            if not whole:
                return
            yield frame

    def __enter__(self) -> VideoReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._capture.release()


class VideoWriter:
    """Writes frames to an .mp4 file; opened by the first one. Use it as a context manager.

    path: None where no frame will come.
    """

    def __init__(self, path: Path | None, rate: float) -> None:
        self._path, self._rate = path, rate
        self._writer: Any = None

    def add(self, bgr: np.ndarray) -> None:
        """One frame; all of one size. DataError where the file cannot be written."""
        if self._writer is None:
            if self._path is None:
                raise ValueError("a frame, but no file to write it to")
            cv2 = _opencv()
            try:
                self._path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise DataError(f"{self._path}: cannot be written ({error.strerror})") from error
            height, width = bgr.shape[:2]
            code = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), code, self._rate, (width, height))
            if not self._writer.isOpened():
                raise DataError(f"{self._path}: cannot be written as video")
        self._writer.write(np.ascontiguousarray(bgr))

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.release()


def _check_file(path: Path) -> None:
    try:
        check_regular(path, MAX_BYTES)
        with path.open("rb") as file:
            start = file.read(16)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
    if not any(start[place:].startswith(mark) for place, mark in _BEGINNINGS):
        raise DataError(f"{path}: cannot be opened as video; it is cut off or none")


def _opencv() -> Any:
    # Its own lines would stand beside the one that says what went wrong.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    try:
        import cv2
    except ImportError as error:
        raise ModelError(f"OpenCV is not installed: {INSTALL}") from error
    opencv: Any = cv2
    levels = opencv if hasattr(opencv, "setLogLevel") else opencv.utils.logging  # so from OpenCV 5 on
    levels.setLogLevel(0)
    return cv2

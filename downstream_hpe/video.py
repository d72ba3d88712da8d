# SPDX-License-Identifier: MIT
"""Video files and webcams, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, ModelError

SUFFIXES = {".mp4", ".mov", ".avi", ".mkv", ".webm"}
FALLBACK_RATE = 30.0
"""Frames a second, where a camera or file does not say."""


class VideoReader:
    """Frames of a file (its path) or a webcam (its number, from 0). Use it as a context manager.

    rate: frames a second.

    Raises
    ------
    DataError: it cannot be opened. ModelError: OpenCV, which comes with mediapipe, is missing.
    """

    def __init__(self, source: Path | int) -> None:
        cv2 = _opencv()
        self._capture = cv2.VideoCapture(source if isinstance(source, int) else str(source))
        if not self._capture.isOpened():
            what = f"webcam {source}" if isinstance(source, int) else str(source)
            raise DataError(f"{what}: cannot be opened as video")
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.rate = rate if np.isfinite(rate) and rate > 0 else FALLBACK_RATE

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
    """Writes frames to an .mp4 file; opened by the first one. Use it as a context manager."""

    def __init__(self, path: Path, rate: float) -> None:
        self._path, self._rate = path, rate
        self._writer: Any = None

    def add(self, bgr: np.ndarray) -> None:
        """One frame; all of one size. DataError where the file cannot be written."""
        if self._writer is None:
            cv2 = _opencv()
            height, width = bgr.shape[:2]
            code = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), code, self._rate, (width, height))
            if not self._writer.isOpened():
                raise DataError(f"{self._path}: cannot be written as video; expected an .mp4 file")
        self._writer.write(np.ascontiguousarray(bgr))

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.release()


def _opencv() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise ModelError("OpenCV is not installed: pip install mediapipe==0.10.21") from error
    return cv2

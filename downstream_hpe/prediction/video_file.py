# SPDX-License-Identifier: MIT
"""Videos out: H.264 in an .mp4 file, with the time of every frame, which browsers and phones play."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.ffmpeg import ffmpeg, reason

TICKS = 60_000
"""Of a second; MPEG-4 Part 2 counts no more than 65,535."""
CODECS = ("libx264", "mpeg4")
"""The first that there is: PyAV's wheels have both, others not always the first."""
QUALITY = {"crf": "20", "preset": "veryfast"}


class VideoWriter:
    """Writes frames; opened by the first one. Use it as a context manager. path: None where none comes."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._container: Any = None
        self._stream: Any = None
        self._last = -1

    def add(self, bgr: np.ndarray, time_s: float) -> None:
        """One frame; all of one size, their times rise. DataError where the file cannot be written."""
        if self._path is None:
            raise ValueError("a frame, but no file to write it to")
        av = ffmpeg()
        # Its colours are of half the size, which must be whole.
        height, width = bgr.shape[:2]
        even = np.pad(bgr, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        try:
            if self._container is None:
                self._open(av, even)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="bgr24")
            self._last = max(self._last + 1, round(time_s * TICKS))
            frame.pts, frame.time_base = self._last, Fraction(1, TICKS)
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except (OSError, av.error.FFmpegError) as error:
            raise DataError(f"{self._path}: cannot be written ({reason(error)})") from error

    def _open(self, av: Any, bgr: np.ndarray) -> None:
        path: Any = self._path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "faststart"})
        codec = next(name for name in CODECS if name in av.codecs_available)
        self._stream = self._container.add_stream(codec, rate=30, options=QUALITY)
        self._stream.height, self._stream.width = bgr.shape[:2]
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = Fraction(1, TICKS)

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._container is None:
            return
        av = ffmpeg()
        try:
            for packet in self._stream.encode(None):
                self._container.mux(packet)
            self._container.close()
        except (OSError, av.error.FFmpegError) as error_here:
            if kind is None:
                raise DataError(f"{self._path}: cannot be written ({reason(error_here)})") from error_here

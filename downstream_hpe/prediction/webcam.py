# SPDX-License-Identifier: MIT
"""Webcams, frame by frame, by OpenCV, which numbers them alike on every system."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.prediction.video import Frame

DEVICES = Path("/dev")
"""Where Linux has them, as video0 and so on."""


class Webcam:
    """The webcam of a number, from 0. Close it. size: width and height of a frame, pixels.

    Raises
    ------
    DataError: there is none, or it gives no picture. ModelError: OpenCV is missing.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._capture = _opencv().VideoCapture(number)
        first: Any
        whole, first = self._capture.read() if self._capture.isOpened() else (False, None)
        if not whole:
            self._capture.release()
            raise DataError(f"webcam:{number}: {_why_not(number)}")
        self._first: Any = first
        self.size = (first.shape[1], first.shape[0])
        self._began = time.monotonic()
        self._last_s = 0.0

    def __iter__(self) -> Iterator[Frame]:
        """A frame whenever it is asked for one, with the time since the first."""
        while self._first is not None:
            yield self._first, self._last_s
            whole, frame = self._capture.read()
            self._last_s = max(time.monotonic() - self._began, np.nextafter(self._last_s, np.inf))
            self._first = frame if whole else None

    def shortfall(self) -> str | None:
        """One line, once it gives no more frames."""
        name = f"webcam:{self._number}"
        return f"{name}: gives no more pictures after {self._last_s:.2f} s; what there was is kept"

    def close(self) -> None:
        """Let go of it."""
        self._capture.release()


def usable_webcams() -> dict[int, bool] | None:
    """Numbers of the webcams of this machine, in order, and whether each may be used; None where only opening
    one tells."""
    if sys.platform != "linux":
        return None
    numbers = sorted(int(d.name[5:]) for d in DEVICES.glob("video*") if d.name[5:].isdecimal())
    return {n: os.access(DEVICES / f"video{n}", os.R_OK | os.W_OK) for n in numbers}


def _why_not(number: int) -> str:
    if sys.platform != "linux":
        return "there is no such webcam, it may not be used, or another program uses it"
    device = DEVICES / f"video{number}"
    there = usable_webcams() or {}
    if not device.exists():
        some = f"; there is {', '.join(f'webcam:{n}' for n in there)}" if there else ", nor any other"
        return f"there is no such webcam{some}"
    if not there.get(number):
        return f"{device} may not be used; who is in the group video may"
    return "gives no picture: another program uses it, or it is no camera"


def _opencv() -> Any:
    # Its own lines would stand beside the one that says what went wrong.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    try:
        import cv2
    except ImportError as error:
        from downstream_hpe.release import install_detector

        raise ModelError(f"OpenCV is not installed: {install_detector()}") from error
    opencv: Any = cv2
    levels = opencv if hasattr(opencv, "setLogLevel") else opencv.utils.logging  # so from OpenCV 5 on
    levels.setLogLevel(0)
    return cv2

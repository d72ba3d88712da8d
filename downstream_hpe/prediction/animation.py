# SPDX-License-Identifier: MIT
"""Pictures that move: GIF, WebP, PNG and AVIF with several frames, read by Pillow."""

from __future__ import annotations

from collections.abc import Iterator

from PIL import Image

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.float_files import BROKEN, check_size
from downstream_hpe.prediction.modes import rgb_of_mode
from downstream_hpe.prediction.pictures import (
    MAX_PIXELS,
    ON_ITS_SIDE,
    File,
    bgr_turned,
    formats,
    quiet_warnings,
    turn_upright,
)
from downstream_hpe.prediction.video import Frame

MOVING = ("GIF", "WEBP", "PNG", "AVIF")
"""What is shown one frame after the other: those of a TIFF are pages, and a JPEG's a second picture."""
LEAST_S, USUAL_S = 0.011, 0.1
"""A frame of a shorter time is shown for USUAL_S, as browsers do."""


def is_animated(file: File) -> bool:
    """Whether a picture that can be read has several frames. A file in memory is left at its beginning."""
    try:
        with quiet_warnings(), Image.open(file, formats=_moving()) as image:
            moves = bool(getattr(image, "is_animated", False))
    except BROKEN:
        moves = False
    if not hasattr(file, "suffix"):
        file.seek(0)
    return moves


class Animation:
    """Frames of a picture's file. Close it. size: width and height, pixels.

    DataError: it is not readable, or of more than MAX_PIXELS.
    """

    def __init__(self, file: File, name: str) -> None:
        self._name, self._broken, self._time_s = name, False, 0.0
        try:
            with quiet_warnings():
                self._image = Image.open(file, formats=_moving())
                width, height = self._image.size
                check_size(name, width, height, MAX_PIXELS)
                self._turn = turn_upright(self._image)
        except BROKEN as error:
            raise DataError(f"{name}: not a readable picture") from error
        self.size = (height, width) if self._turn in ON_ITS_SIDE else (width, height)

    def __iter__(self) -> Iterator[Frame]:
        """Each frame as a browser shows it, with the time since the first."""
        number = 0
        while True:
            try:
                with quiet_warnings():
                    self._image.seek(number)
                    rgb = rgb_of_mode(self._image)
                shown_s = float(self._image.info.get("duration") or 0) / 1000
            except EOFError:
                return
            except BROKEN:
                self._broken = True
                return
            yield bgr_turned(rgb, self._turn), round(self._time_s, 6)
            self._time_s += shown_s if shown_s >= LEAST_S else USUAL_S
            number += 1

    def shortfall(self) -> str | None:
        """One line, once all frames were asked for, where one of them is damaged; else None."""
        if not self._broken:
            return None
        return f"{self._name}: ended after {self._time_s:.2f} s, where it is damaged; what there was is kept"

    def close(self) -> None:
        """Let go of it."""
        self._image.close()


def _moving() -> tuple[str, ...]:
    return tuple(name for name in formats() if name in MOVING)

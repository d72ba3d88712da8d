# SPDX-License-Identifier: GPL-3.0-or-later
"""The door to every image of a dataset: PNG or JPEG, of a size that a build makes, known from its header."""

from __future__ import annotations

import io
import struct
import warnings
from pathlib import Path

from PIL import Image

from generator.errors import DatasetError
from generator.reading import read_limited

FORMATS = ("PNG", "JPEG")
"""No other decoder of Pillow or OpenCV is let near a stranger's file."""

MAX_PIXELS = 4096 * 4096
"""The largest resolution that a build takes."""

MAX_IMAGE_BYTES = 1 << 26
"""More than that many pixels have as PNG."""

_BROKEN = (OSError, SyntaxError, ValueError, EOFError, ArithmeticError, LookupError, struct.error)


def read_image(path: Path) -> bytes:
    """The bytes of an image's file. Raises DatasetError: no regular file, too large, or not readable."""
    try:
        return read_limited(path, MAX_IMAGE_BYTES)
    except ValueError as error:
        raise DatasetError(f"{path}: {error}; see `headturn verify`") from error
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read ({error.strerror}); see `headturn verify`") from error


def decode_image(encoded: bytes, name: str) -> Image.Image:
    """The image in RGB. name: what it is, for messages, such as "the image of s1/neutral/y+0_p+0_r+0".

    Raises DatasetError: not of FORMATS, damaged, or of more pixels than MAX_PIXELS.
    """
    try:
        with _opened(encoded, name) as image:
            return image.convert("RGB")
    except _BROKEN as error:
        raise DatasetError(f"{name} cannot be decoded; see `headturn verify`") from error


def image_format(encoded: bytes, name: str) -> str:
    """Which of FORMATS it is, by its header. Raises DatasetError as :func:`decode_image` does."""
    try:
        with _opened(encoded, name) as image:
            return str(image.format)
    except _BROKEN as error:
        raise DatasetError(f"{name} cannot be decoded; see `headturn verify`") from error


def _opened(encoded: bytes, name: str) -> Image.Image:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            image = Image.open(io.BytesIO(encoded), formats=FORMATS)
            pixels = image.width * image.height
        except Image.DecompressionBombError:
            pixels = MAX_PIXELS + 1
    if pixels > MAX_PIXELS:
        raise DatasetError(f"{name} has more than {MAX_PIXELS:,} pixels, which no build makes")
    return image

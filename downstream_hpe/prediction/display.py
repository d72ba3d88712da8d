# SPDX-License-Identifier: MIT
"""How a decoded frame is shown: turned as its display matrix says, with square pixels."""

from __future__ import annotations

import struct
from fractions import Fraction
from typing import Any

import numpy as np

Matrix = tuple[int, int, int, int]
"""(a, b, c, d): a stored pixel (x, y), down the rows, is shown at (a x + c y, b x + d y), but for a shift."""
IDENTITY: Matrix = (1, 0, 0, 1)


def display_matrix(frame: Any) -> Matrix:
    """Of a frame of PyAV's: what QuickTime, MP4, Matroska or the video itself say.

    The nearest turn by quarters, mirrored or not: no camera says another.
    """
    try:
        side = next((one for one in frame.side_data if one.type.name == "DISPLAYMATRIX"), None)
    except ValueError:
        # PyAV knows no EXIF, as Motion JPEG may have it, and then tells the angle alone.
        angle = np.deg2rad(frame.rotation)
        cosine, sine = round(np.cos(angle)), round(np.sin(angle))
        return cosine, -sine, sine, cosine
    if side is None or side.buffer_size < 36:
        return IDENTITY
    a, b, _, c, d = struct.unpack("=5i", bytes(side)[:20])
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return (-1 if a < 0 else 1), 0, 0, (-1 if d < 0 else 1)
    return 0, (-1 if b < 0 else 1), (-1 if c < 0 else 1), 0


def shown(pixels: np.ndarray, matrix: Matrix) -> np.ndarray:
    """An array [H, W, 3] as its matrix shows it; a view."""
    a, b, c, d = matrix
    if not a:
        pixels = np.swapaxes(pixels, 0, 1)
        a, d = c, b
    return pixels[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]


def square_size(width: int, height: int, aspect: Fraction | None) -> tuple[int, int]:
    """Width and height with square pixels, none of the frame's lost. aspect: width to height of a pixel."""
    if not aspect or not Fraction(1, 10) < aspect < 10:
        return width, height
    return (round(width * aspect), height) if aspect >= 1 else (width, round(height / aspect))

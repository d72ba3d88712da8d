# SPDX-License-Identifier: MIT
"""Rotated squares of a picture, cut out as MediaPipe's ImageToTensorCalculator does it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from litert_faces.errors import FinderError, PictureError
from litert_faces.installing import install_with_these

LONGEST = (1 << 15) - 2
"""OpenCV's warpPerspective takes no more."""


@dataclass(frozen=True)
class Square:
    """centre [2], pixels; side, pixels; angle, radians, clockwise as one sees it."""

    centre: np.ndarray
    side: float
    angle: float = 0.0

    @staticmethod
    def around(rgb: np.ndarray) -> Square:
        """The upright one that just holds a picture."""
        height, width = rgb.shape[:2]
        return Square(np.array([width, height]) / 2, float(max(height, width)))

    @property
    def axes(self) -> np.ndarray:
        """[2, 2]: from places in units of the side, (right, down), to pixels."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return self.side * np.array([[cos, -sin], [sin, cos]])

    def pixels(self, places: np.ndarray) -> np.ndarray:
        """Places in the square, 0 to 1, as pixels of the picture. [..., 2]"""
        return (places - 0.5) @ self.axes.T + self.centre

    def overlap(self, other: Square) -> float:
        """Intersection over union, as if both were upright, which is how MediaPipe compares them."""
        reach = (self.side + other.side) / 2 - np.abs(self.centre - other.centre)
        shared = float(np.clip(reach, 0, min(self.side, other.side)).prod())
        return shared / (self.side**2 + other.side**2 - shared)

    def cut(self, rgb: np.ndarray, size: int, low: float, replicate: bool) -> np.ndarray:
        """float32 [1, size, size, 3], low to 1. replicate: beyond the edge lies its last pixel, else black.

        rgb: uint8 [H, W, 3]. PictureError: a side is longer than LONGEST.
        """
        if max(rgb.shape) > LONGEST:
            raise PictureError(f"{rgb.shape[1]} x {rgb.shape[0]} pixels, more than {LONGEST:,} in a line")
        try:
            import cv2
        except ImportError as error:
            raise FinderError(f"OpenCV is not installed: {install_with_these('litert')}") from error
        corners = np.array([[0, 1], [0, 0], [1, 0], [1, 1]], dtype=np.float32)
        # As MediaPipe has it: corners of the square on corners of the first and last pixels but half a pixel.
        turn = cv2.getPerspectiveTransform(self.pixels(corners).astype(np.float32), size * corners)
        border = cv2.BORDER_REPLICATE if replicate else cv2.BORDER_CONSTANT
        square = cv2.warpPerspective(rgb, turn, (size, size), flags=cv2.INTER_LINEAR, borderMode=border)
        scaled: np.ndarray = square.astype(np.float32) * np.float32((1 - low) / 255) + np.float32(low)
        return scaled[None]

# SPDX-License-Identifier: MIT
"""Pictures in and out: read one, draw the axes of a head on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageOps, UnidentifiedImageError

from downstream_hpe.errors import DataError

AXES = ((0, (255, 60, 60)), (1, (60, 200, 60)), (2, (80, 120, 255)))
"""Columns of R_C and their colours: image-right red, down green, and ahead of the nose blue."""


def read_bgr(path: Path) -> np.ndarray:
    """uint8 [H, W, 3], BGR, upright. DataError where it is not a picture."""
    try:
        with Image.open(path) as image:
            rgb = ImageOps.exif_transpose(image).convert("RGB")
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise DataError(f"{path}: not a readable picture") from error
    return np.asarray(rgb)[..., ::-1]


def draw_axes(bgr: np.ndarray, landmarks: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """The picture with the head's axes from the middle of the face; the blue one points where the nose does.

    bgr: uint8 [H, W, 3]. landmarks: float [468, 3], pixels. rotation: R_C, float [3, 3].
    """
    image = Image.fromarray(np.ascontiguousarray(bgr[..., ::-1]))
    draw = ImageDraw.Draw(image)
    centre = landmarks[:, :2].mean(axis=0)
    length = np.ptp(landmarks[:, 1]) / 2
    for column, colour in AXES:
        # The nose looks along -z of its own frame, towards the camera at pose zero.
        direction = rotation[:2, column] * (-1 if column == 2 else 1)
        ends = [tuple(centre), tuple(centre + length * direction)]
        draw.line(ends, fill=colour, width=max(2, round(length / 25)))
    return np.asarray(image)[..., ::-1]


def write_bgr(bgr: np.ndarray, path: Path) -> None:
    """uint8 [H, W, 3] to a file, by its suffix."""
    Image.fromarray(np.ascontiguousarray(bgr[..., ::-1])).save(path)

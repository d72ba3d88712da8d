# SPDX-License-Identifier: MIT
"""The camera of a picture: from its field of view, from a file with K, or guessed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.camera import Camera
from downstream_hpe.reading import MAX_TEXT_BYTES, parse_json, read_limited

GUESSED_FOV_DEG = 60.0
"""Along the longer side: between a phone's main camera, 69 degrees, and a portrait lens, 24."""
_SAME_RATIO = 0.01
_EXPECTED = (
    'expected {"K": [[fx, s, cx], [0, fy, cy], [0, 0, 1]]}, and "width" and "height" in pixels if known'
)

CameraOf = Callable[[int, int], Camera]
"""The camera of a picture of so many pixels, width and height."""


def guessed_camera(width: int, height: int) -> Camera:
    """A CameraOf where nothing is known."""
    return Camera.from_fov(GUESSED_FOV_DEG, width, height, guessed=True)


def chosen_camera(fov_deg: float | None, file: Path | None) -> CameraOf:
    """What --fov and --camera say; without either, a guess.

    Raises
    ------
    UsageError: both. DataError: as :func:`camera_file`.
    """
    if fov_deg is not None and file is not None:
        raise UsageError("--fov and --camera both say what the camera is; give one")
    if file is not None:
        return camera_file(file)
    if fov_deg is not None:
        return lambda width, height: Camera.from_fov(fov_deg, width, height)
    return guessed_camera


def camera_file(file: Path) -> CameraOf:
    """The camera of a JSON file: {"K": 3 x 3 numbers}, with "width" and "height" if K is to be scaled to
    pictures of another size. K is of upright pictures, in pixels, without distortion.

    What it returns raises DataError for a picture that has not the file's proportions.

    Raises
    ------
    DataError: not readable, or no such matrix.
    """
    try:
        facts = parse_json(read_limited(file, MAX_TEXT_BYTES))
        matrix = np.array(facts["K"], dtype=np.float64)
        size = [facts.get(side) for side in ("width", "height")]
    except (OSError, KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise DataError(f"{file}: not readable as a camera; {_EXPECTED}") from error
    sound = matrix.shape == (3, 3) and np.isfinite(matrix).all() and (np.abs(matrix) < 1e9).all()
    if not sound or min(matrix[0, 0], matrix[1, 1]) <= 0 or matrix[1, 0] or [*matrix[2]] != [0, 0, 1]:
        raise DataError(f"{file}: K is no camera matrix; {_EXPECTED}")
    if size == [None, None]:
        return lambda width, height: Camera(matrix)
    if not all(type(side) in (int, float) and 1 <= side < 1e9 for side in size):
        raise DataError(f"{file}: width and height are no size; {_EXPECTED}")

    def scaled(width: int, height: int) -> Camera:
        across, down = width / size[0], height / size[1]
        if abs(across / down - 1) > _SAME_RATIO:
            raise DataError(f"{width} x {height} pixels, and {file} is for {size[0]} x {size[1]}")
        return Camera(np.diag([across, down, 1.0]) @ matrix)

    return scaled

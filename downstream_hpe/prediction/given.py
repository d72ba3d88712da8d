# SPDX-License-Identifier: MIT
"""Pictures as programs have them: the path of a file, a picture of Pillow's, or an array."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

import numpy as np
from PIL import Image, ImageOps

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.modes import rgb_of_mode
from downstream_hpe.prediction.pictures import read_bgr

Picture: TypeAlias = str | os.PathLike[str] | Image.Image | np.ndarray
"""A path (str or Path), a PIL.Image, or uint8 [H, W, 3], [H, W, 4] or, of grey, [H, W] or [H, W, 1]."""

_BROKEN = (OSError, SyntaxError, ValueError, EOFError)


def rgb_of(picture: Picture, *, bgr: bool = False) -> np.ndarray:
    """uint8 [H, W, 3], contiguous, RGB, upright as its EXIF says; it may be the very array that was given.

    bgr: an array has the order of OpenCV's. What is transparent shows the colour that lies under it.
    DataError: a file that cannot be read, or something else; one line with what was expected.

    >>> rgb_of(np.zeros((2, 3), np.uint8)).shape
    (2, 3, 3)
    >>> rgb_of(None)
    Traceback (most recent call last):
    ...
    downstream_hpe.errors.DataError: expected a picture: a path, a PIL.Image or an array, got None, which \
cv2.imread gives where there is no picture
    """
    if isinstance(picture, np.ndarray):
        return _of_array(picture, bgr)
    if isinstance(picture, Image.Image):
        return _of_pillow(picture)
    if isinstance(picture, str | os.PathLike):
        path = os.fspath(picture)
        if not isinstance(path, str) or not path:
            raise DataError(f"expected a picture: its path is {path!r}")
        return np.ascontiguousarray(read_bgr(Path(path))[..., ::-1])
    what = type(picture).__name__
    if picture is None:
        what = "None, which cv2.imread gives where there is no picture"
    elif isinstance(picture, list | tuple):
        what = f"a {what}; give one picture at a time, or np.asarray of what is one"
    raise DataError(f"expected a picture: a path, a PIL.Image or an array, got {what}")


def without_copy(bgr: np.ndarray) -> np.ndarray:
    """The other order of channels, uint8 [H, W, 3], contiguous; not copied where that is how it lies in
    memory, as with pictures out of files."""
    rgb = bgr[..., ::-1]
    # Four times as quick as np.ascontiguousarray: 3 instead of 14 ms of a frame of 1920 x 1080.
    return rgb if rgb.flags.c_contiguous else np.take(bgr, (2, 1, 0), axis=-1)


def _of_array(array: np.ndarray, bgr: bool) -> np.ndarray:
    order = "BGR" if bgr else "RGB"
    grey = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 1)
    coloured = array.ndim == 3 and array.shape[2] in (3, 4)
    if array.dtype != np.uint8 or not (grey or coloured) or not array.size:
        raise DataError(
            f"expected a uint8 picture [H, W, 3], {order}, or [H, W, 4] or grey [H, W], "
            f"got {array.dtype} {array.shape}{_advice(array)}"
        )
    if grey:
        return np.repeat(array.reshape(*array.shape[:2], 1), 3, axis=2)
    return without_copy(array[..., :3]) if bgr else np.ascontiguousarray(array[..., :3])


def _advice(array: np.ndarray) -> str:
    if not array.size:
        return ""
    if array.ndim == 3 and array.shape[0] in (3, 4) and array.shape[2] not in (1, 3, 4):
        return "; channels come last: np.moveaxis(picture, 0, -1)"
    if array.ndim == 4:
        return "; give one picture at a time"
    if array.dtype.kind == "f":
        return "; of 0 to 1 it is (255 * picture).round().astype(np.uint8)"
    return "; of 16 bits it is (picture // 257).astype(np.uint8)" if array.dtype == np.uint16 else ""


def _of_pillow(picture: Image.Image) -> np.ndarray:
    if not picture.width or not picture.height:
        raise DataError(f"expected a picture, got one of {picture.width} x {picture.height} pixels")
    try:
        return np.asarray(rgb_of_mode(ImageOps.exif_transpose(picture)))
    except _BROKEN as error:
        raise DataError(f"a picture that cannot be read ({error})") from error

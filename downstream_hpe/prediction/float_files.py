# SPDX-License-Identifier: MIT
"""Pictures of floats, which Pillow does not read: OpenEXR and Radiance HDR by FFmpeg, TIFF by tifffile."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.depth import from_floats, from_whole
from downstream_hpe.prediction.ffmpeg import ffmpeg

BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    ArithmeticError,
    LookupError,
    TypeError,
    struct.error,
    MemoryError,
    Image.DecompressionBombError,
)
"""What readers of pictures raise at damaged files."""
LINE = "\n"
MAX_BYTES = 1 << 30
"""Of the numbers of a TIFF."""
HALF = "f16"
"""In FFmpeg's names of formats."""
PIPES = "exr_pipe,hdr_pipe"
"""The demultiplexers that may be used."""


def read_light(path: Path, limit: int) -> np.ndarray:
    """uint8 [H, W, 3], RGB, of an OpenEXR or HDR file, which hold light.

    DataError: not readable, or of more than limit pixels. ModelError: PyAV is missing.
    """
    av = ffmpeg()
    only = {"protocol_whitelist": "file", "format_whitelist": PIPES}
    try:
        with av.open(f"file:{path.absolute()}", options=only) as container:
            stream = container.streams.video[0]
            check_size(path, stream.codec_context.width, stream.codec_context.height, limit)
            frame = next(container.decode(stream))
            values = _halves(frame) if HALF in frame.format.name else frame.to_ndarray()
    except (av.error.FFmpegError, ValueError, IndexError, StopIteration) as error:
        raise DataError(f"{path}: not a readable picture") from error
    # How opaque a pixel is, is no light.
    return _rgb(path, from_floats(values[..., :3] if values.ndim == 3 else values, linear=True))


def _halves(frame: Any) -> np.ndarray:
    """float16 [H, W, 3] or, of grey, [H, W], of a frame of halves, which PyAV does not make an array."""
    kind = ">f2" if frame.format.name.endswith("be") else "<f2"
    planes = [
        np.frombuffer(plane, kind).reshape(-1, plane.line_size // 2)[: frame.height, : frame.width]
        for plane in frame.planes
    ]
    # Green, blue, red, and perhaps how opaque.
    return np.dstack([planes[2], *planes[:2]]) if len(planes) > 2 else planes[0]


def read_tiff(path: Path, limit: int) -> tuple[np.ndarray, int]:
    """The first page of a TIFF that Pillow does not read: uint8 [H, W, 3], RGB, as it lies there; and its
    tag Orientation. DataError: as above, or no tifffile."""
    try:
        import tifffile
    except ImportError as error:
        raise DataError(
            f"{path}: a TIFF that Pillow does not read, of colours as floats, say; pip install tifffile"
        ) from error
    # Else its warnings go to the terminal, where a program has no log.
    logging.getLogger("tifffile").addHandler(logging.NullHandler())
    try:
        with tifffile.TiffFile(path) as file:
            page: Any = file.pages[0]
            check_size(path, page.imagewidth, page.imagelength, limit)
            if page.nbytes > MAX_BYTES:
                raise ValueError(f"{page.nbytes:,} bytes of numbers")
            values = page.asarray()
            separate = page.planarconfig == tifffile.PLANARCONFIG.SEPARATE
            negative = page.photometric == tifffile.PHOTOMETRIC.MINISWHITE
            orientation = int(page.tags.valueof("Orientation", 1))
    except BROKEN as error:
        raise DataError(f"{path}: not a readable TIFF ({str(error).partition(LINE)[0]})") from error
    if values.ndim == 3 and separate:
        values = np.moveaxis(values, 0, -1)
    if values.dtype.kind not in "fiu":
        raise DataError(f"{path}: not a readable picture ({values.dtype} is no number of a pixel)")
    rgb = _rgb(path, from_floats(values) if values.dtype.kind == "f" else from_whole(values))
    return 255 - rgb if negative else rgb, orientation


def check_size(path: Path | str, width: int, height: int, limit: int) -> None:
    """DataError: of no pixels, or of more than limit."""
    if width <= 0 or height <= 0:
        raise DataError(f"{path}: a picture of {width} x {height} pixels has none to look at")
    if width * height > limit:
        raise DataError(
            f"{path}: a picture of more than {limit:,} pixels ({width} x {height}); make it smaller"
        )


def _rgb(path: Path, values: np.ndarray) -> np.ndarray:
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim != 3 or values.shape[2] not in (1, 2, 3, 4):
        raise DataError(f"{path}: not a readable picture (its values have shape {values.shape})")
    colours = values[..., :3] if values.shape[2] > 2 else np.repeat(values[..., :1], 3, axis=2)
    return np.ascontiguousarray(colours)

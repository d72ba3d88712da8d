# SPDX-License-Identifier: MIT
"""Pictures in and out."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from downstream_hpe.errors import DataError
from downstream_hpe.reading import check_regular

FORMATS = ("JPEG", "PNG", "BMP", "WEBP", "TIFF")
"""Those of the suffixes that count as pictures. JPEG 2000 is none: its decoders have been attacked."""
MAX_BYTES = 1 << 30
MAX_PIXELS = 1 << 26
"""8192 x 8192; three times as many bytes, twice over, while it is turned upright."""
_BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    ArithmeticError,
    LookupError,
    TypeError,
    struct.error,
    MemoryError,
)


def read_bgr(path: Path) -> np.ndarray:
    """uint8 [H, W, 3], BGR, upright.

    DataError: no picture, not of FORMATS, or of more than MAX_PIXELS, by its header.
    """
    try:
        check_regular(path, MAX_BYTES)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise Image.DecompressionBombError
                rgb = ImageOps.exif_transpose(image).convert("RGB")
    except FileNotFoundError as error:
        raise DataError(f"{path}: there is no such picture") from error
    except Image.DecompressionBombError as error:
        raise DataError(f"{path}: a picture of more than {MAX_PIXELS:,} pixels; make it smaller") from error
    # Pillow raises what it likes at damaged files.
    except _BROKEN as error:
        raise DataError(f"{path}: not a readable picture") from error
    return np.asarray(rgb)[..., ::-1]


def write_bgr(bgr: np.ndarray, path: Path) -> None:
    """uint8 [H, W, 3] to a file, by its suffix; its folder is made. DataError where that fails."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # The quality is that of a JPEG; lossy colours would fray the lines.
        Image.fromarray(np.ascontiguousarray(bgr[..., ::-1])).save(path, quality=95)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error

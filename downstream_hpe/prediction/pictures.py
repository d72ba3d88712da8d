# SPDX-License-Identifier: MIT
"""Pictures in and out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from downstream_hpe.errors import DataError


def read_bgr(path: Path) -> np.ndarray:
    """uint8 [H, W, 3], BGR, upright. DataError where there is no picture."""
    try:
        with Image.open(path) as image:
            rgb = ImageOps.exif_transpose(image).convert("RGB")
    except FileNotFoundError as error:
        raise DataError(f"{path}: there is no such picture") from error
    # Pillow raises SyntaxError and ValueError, too, at damaged files.
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
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

# SPDX-License-Identifier: GPL-3.0-or-later
"""Image files from strangers: are they images, how big, and does their alpha cut holes?"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from generator.errors import HeadError

FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "TGA", "WEBP")
"""What both Pillow and Blender read."""

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".tga", ".webp")

OPAQUE = 128
"""An alpha of this and above is solid."""

HOLES = 0.01
"""A material is a cutout if more of its surface than this is transparent."""

_SAMPLES = 200_000


@contextmanager
def open_image(path: Path) -> Iterator[Image.Image]:
    """An image whose header was read and whose size is sane.

    Raises
    ------
    HeadError: not an image of :data:`FORMATS`, broken, or more pixels than
        Pillow's ``MAX_IMAGE_PIXELS`` (89 million: a decompression bomb).
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                yield image
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise HeadError(f"the texture {path} has too many pixels ({error}); make it smaller") from error
    except UnidentifiedImageError as error:
        raise HeadError(f"the texture {path} is not an image ({', '.join(FORMATS)} expected)") from error
    except (OSError, SyntaxError, ValueError, EOFError, ArithmeticError, LookupError) as error:
        raise HeadError(f"the texture {path} is broken ({_line(error)}); replace it") from error


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels, from the header alone."""
    with open_image(path) as image:
        return image.size


def check_image(path: Path) -> None:
    """Decode all of an image, so that a truncated one is found before a renderer paints it pink."""
    with open_image(path) as image:
        # JPEG can decode at an eighth of its size, which reads every byte at a fraction of the time.
        image.draft("RGB", (max(1, image.width // 8), max(1, image.height // 8)))
        image.load()


def has_holes(path: Path, uv: np.ndarray) -> bool:
    """Does the alpha channel make holes where triangles use the texture?

    Unused corners of an atlas are often transparent, and some exporters leave
    an alpha channel that is empty throughout: neither makes a cutout.

    Parameters
    ----------
    path: image. uv: float [T, 3, 2], v up, of the triangles drawn with it.

    Raises
    ------
    HeadError: the image cannot be used, or a texture coordinate is not finite.
    """
    if not np.isfinite(uv).all():
        raise HeadError(f"a texture coordinate of {path.name} is not a finite number; export the mesh again")
    with open_image(path) as image:
        if not image.has_transparency_data or not len(uv):
            return False
        alpha = np.asarray(image.convert("RGBA").getchannel("A"))
    if alpha.min() >= OPAQUE or alpha.max() < OPAQUE:
        return False
    side = int(np.clip(np.sqrt(_SAMPLES / len(uv)), 3, 64))
    # Cell centres of a barycentric grid: all inside, so that the border of an atlas island does not count.
    a, b = (grid.ravel() for grid in np.mgrid[0:side, 0:side])
    inside = a + b < side
    weights = (np.stack([a, b], axis=1)[inside] + 1 / 3) / side
    weights = np.column_stack([weights, 1 - weights.sum(1)])
    points = np.einsum("kc,tcd->tkd", weights, uv) % 1.0
    height, width = alpha.shape
    columns = np.minimum((points[..., 0] * width).astype(int), width - 1)
    rows = np.minimum(((1.0 - points[..., 1]) * height).astype(int), height - 1)
    return float((alpha[rows, columns] < OPAQUE).mean()) > HOLES


def combine_alpha(color: Path, opacity: Path, target: Path) -> None:
    """Write ``color`` with ``opacity`` (its alpha, else its brightness) as alpha channel, a PNG."""
    with open_image(opacity) as image:
        mask = image.convert("RGBA").getchannel("A") if image.has_transparency_data else image.convert("L")
    with open_image(color) as image:
        combined = image.convert("RGB")
    combined.putalpha(mask.resize(combined.size))
    combined.save(target, compress_level=1)

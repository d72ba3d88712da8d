# SPDX-License-Identifier: GPL-3.0-or-later
"""Image files from strangers: are they images, how big, and does their alpha cut holes?"""

from __future__ import annotations

import contextlib
import struct
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image, UnidentifiedImageError

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_PIXELS, MAX_TEXTURE_PIXELS, check_mesh_file
from generator.heads.mesh import Material
from generator.heads.tiling import EXTEND, bring_back, needs_both, texels

FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "TGA", "WEBP")
"""What both Pillow and Blender read."""

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".tga", ".webp")

OPAQUE = 128
"""An alpha of this and above is solid."""

HOLES = 0.01
"""A material is a cutout if more of its surface than this is transparent."""

_SAMPLES = 200_000

_JPEG_2000 = (b"\0\0\0\x0cjP  \r\n\x87\n", b"\xff\x4f\xff\x51")
"""How a file of it begins, and a stream without a file's frame."""

_BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    ArithmeticError,
    LookupError,
    struct.error,
    MemoryError,
)
"""What Pillow raises at a damaged file; UnidentifiedImageError is an OSError.

A PNG of 62 bytes may say that it goes on for 4 GB, for which Pillow makes room: a MemoryError."""


@contextlib.contextmanager
def open_image(path: Path) -> Iterator[Image.Image]:
    """An image whose header was read and whose size is sane.

    Raises
    ------
    HeadError: not an image of :data:`FORMATS`, broken, or more than
        MAX_TEXTURE_PIXELS (a decompression bomb).
    """
    try:
        check_mesh_file(path)
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                if image.width * image.height > MAX_TEXTURE_PIXELS:
                    size = f"{image.width} x {image.height}"
                    raise HeadError(f"the texture {path} has too many pixels ({size}); make it smaller")
                if image.mode == "F":
                    raise HeadError(f"the texture {path} is made of floating-point numbers; save it as PNG")
                yield image
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise HeadError(f"the texture {path} has too many pixels ({error}); make it smaller") from error
    except UnidentifiedImageError as error:
        if _is_tiff(path):
            raise HeadError(
                f"the texture {path} is a TIFF of a kind that is not read, such as one of floating-point "
                "numbers; save it as PNG"
            ) from error
        raise HeadError(f"the texture {path} is not an image ({', '.join(FORMATS)} expected)") from error
    except _BROKEN as error:
        raise HeadError(f"the texture {path} is broken ({_line(error)}); replace it") from error


def _is_tiff(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels, from the header alone."""
    with open_image(path) as image:
        return image.size


class Textures:
    """The textures of one head. Each is decoded once, however many materials name it.

    Its methods raise HeadError: an image cannot be used, or all of them have more than MAX_PIXELS.
    """

    def __init__(self) -> None:
        self._pixels = 0
        self._alpha: dict[Path, np.ndarray | None] = {}

    def check(self, path: Path) -> None:
        """Decode all of an image, so that a truncated one is found before a renderer paints it pink."""
        self._alpha_of(path)

    def lay(
        self, material: Material, uv: np.ndarray, wraps: tuple[str, str], *, cut: bool = True
    ) -> tuple[Material, np.ndarray, list[str]]:
        """A textured material as some triangles use it.

        Parameters
        ----------
        material: with a texture. uv: float [T, 3, 2], v up, of its triangles. wraps: how the texture goes
            on along u and along v. cut: may its alpha channel make holes?

        Returns
        -------
        The material with ``wrap`` and ``cutout``, its coordinates brought back into the image where they
        can be, and what is to be noted.
        """
        assert material.texture is not None, "only textures are laid"
        uv, wrap = bring_back(uv, wraps)
        notes = []
        if needs_both(uv, wraps):
            notes.append(
                f"the texture of {quoted(material.name)} goes on along u as {wraps[0]}, along v as {wraps[1]}"
                f"; drawn as {wrap}"
            )
        cutout = self.has_holes(material.texture, uv, wrap) and cut
        return replace(material, wrap=wrap, cutout=cutout), uv, notes

    def has_holes(self, path: Path, uv: np.ndarray, wrap: str = EXTEND) -> bool:
        """Does the alpha channel make holes where triangles use the texture?

        Unused corners of an atlas are often transparent, and some exporters leave
        an alpha channel that is empty throughout: neither makes a cutout.

        Parameters
        ----------
        path: image. uv: float [T, 3, 2], v up, of the triangles drawn with it. wrap: how it goes on
            beyond 0-1.

        Raises
        ------
        HeadError: the image cannot be used, or a texture coordinate is not finite.
        """
        if not np.isfinite(uv).all():
            raise HeadError(
                f"a texture coordinate of {path.name} is not a finite number; export the mesh again"
            )
        alpha = self._alpha_of(path)
        if alpha is None or alpha.max() < OPAQUE or len(uv) == 0:
            return False
        return float((_samples(alpha, uv, wrap) < OPAQUE).mean()) > HOLES

    def peak_alpha(self, path: Path, uv: np.ndarray, wraps: tuple[str, str]) -> float:
        """The most, 0-1, that an image's alpha is where triangles use it; 1 without alpha."""
        alpha = self._alpha_of(path)
        if alpha is None or len(uv) == 0:
            return 1.0
        return float(_samples(alpha, *bring_back(uv, wraps)).max()) / 255

    def peak_opacity(self, path: Path, uv: np.ndarray, wraps: tuple[str, str]) -> float:
        """The most, 0-1, that an opacity map is where triangles use it."""
        self.check(path)
        with open_image(path) as image:
            mask = np.asarray(_mask(image))
        return float(_samples(mask, *bring_back(uv, wraps)).max()) / 255 if len(uv) else 1.0

    def mean_red(self, path: Path, uv: np.ndarray, wraps: tuple[str, str]) -> float:
        """How red, 0-1, an image is where triangles use it."""
        self.check(path)
        with open_image(path) as image:
            red = np.asarray(image.convert("RGB").getchannel("R"))
        return float(_samples(red, *bring_back(uv, wraps)).mean()) / 255 if len(uv) else 1.0

    def _alpha_of(self, path: Path) -> np.ndarray | None:
        """uint8 [H, W], None of an image that is solid throughout."""
        if path not in self._alpha:
            with open_image(path) as image:
                self._pixels += image.width * image.height
                if self._pixels > MAX_PIXELS:
                    raise HeadError(f"the textures have more than {MAX_PIXELS:,} pixels; make them smaller")
                self._alpha[path] = _alpha_of(path, image)
        return self._alpha[path]


def check_picture(file: Path | BinaryIO, name: str) -> None:
    """HeadError: JPEG 2000, which no texture is and whose decoders have been attacked, or too many pixels.

    Of files that Blender reads as it sees fit: what is none of :data:`FORMATS` is left to it.
    """
    if isinstance(file, Path):
        check_mesh_file(file)
        with file.open("rb") as opened:
            check_picture(opened, name)
        return
    if file.read(12).startswith(_JPEG_2000):
        raise HeadError(f"the texture {quoted(name)} is JPEG 2000; save it as PNG")
    file.seek(0)
    size = (0, 0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        try:
            with Image.open(file, formats=FORMATS) as image:
                size = image.size
        except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
            raise HeadError(
                f"the texture {quoted(name)} has too many pixels ({error}); make it smaller"
            ) from error
        except _BROKEN:
            return  # Blender says what it thinks of it
    if size[0] * size[1] > MAX_TEXTURE_PIXELS:
        raise HeadError(
            f"the texture {quoted(name)} has too many pixels ({size[0]} x {size[1]}); make it smaller"
        )


def alpha_channel(path: Path) -> np.ndarray | None:
    """uint8 [H, W], None of an image without one. Raises HeadError as :func:`open_image` does."""
    with open_image(path) as image:
        if not image.has_transparency_data:
            return None
        return np.asarray(image.convert("RGBA").getchannel("A"))


_SOLID: dict[tuple[Path, int, int], None] = {}
"""Images that were decoded and found solid throughout: path, bytes, time. Expressions share theirs, and
a head that was placed is read once more to be rendered."""
_MOST_SOLID = 256


def _alpha_of(path: Path, image: Image.Image) -> np.ndarray | None:
    """uint8 [H, W], None of an image, open from path, that is solid throughout."""
    state = path.stat()
    known = path, state.st_size, state.st_mtime_ns
    if known in _SOLID:
        return None
    alpha = _alpha(image)
    if alpha is None:
        if len(_SOLID) >= _MOST_SOLID:
            _SOLID.clear()
        _SOLID[known] = None
    return alpha


def _alpha(image: Image.Image) -> np.ndarray | None:
    if not image.has_transparency_data:
        # JPEG can decode at an eighth of its size, which reads every byte at a fraction of the time.
        image.draft("RGB", (max(1, image.width // 8), max(1, image.height // 8)))
        image.load()
        return None
    alpha = np.asarray(image.convert("RGBA").getchannel("A"))
    return None if alpha.min() == 255 else alpha


def _samples(channel: np.ndarray, uv: np.ndarray, wrap: str) -> np.ndarray:
    """Values of uint8 [H, W] where triangles, float [T, 3, 2], T > 0, use it."""
    side = int(np.clip(np.sqrt(_SAMPLES / len(uv)), 3, 64))
    # Cell centres of a barycentric grid: all inside, so that the border of an atlas island does not count.
    a, b = (grid.ravel() for grid in np.mgrid[0:side, 0:side])
    inside = a + b < side
    weights = (np.stack([a, b], axis=1)[inside] + 1 / 3) / side
    weights = np.column_stack([weights, 1 - weights.sum(1)])
    points = np.einsum("kc,tcd->tkd", weights, uv)
    return channel[texels(points, wrap, channel.shape)]


def combine_alpha(color: Path | tuple[float, float, float], opacity: Path, target: Path) -> None:
    """Write ``color``, an image or sRGB 0-1, with ``opacity`` (its alpha, else its brightness) as alpha
    channel, a PNG."""
    with open_image(opacity) as image:
        mask = _mask(image)
    if isinstance(color, tuple):
        red, green, blue = (round(255 * value) for value in color)
        combined = Image.new("RGB", mask.size, (red, green, blue))
    else:
        with open_image(color) as image:
            combined = image.convert("RGB")
    combined.putalpha(mask.resize(combined.size))
    combined.save(target, compress_level=1)


def _mask(image: Image.Image) -> Image.Image:
    return image.convert("RGBA").getchannel("A") if image.has_transparency_data else image.convert("L")

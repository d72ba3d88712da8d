# SPDX-License-Identifier: MIT
"""Pictures in and out."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import (
    BmpImagePlugin,
    Image,
    ImageFile,
    JpegImagePlugin,
    PngImagePlugin,
    PpmImagePlugin,
    TiffImagePlugin,
    UnidentifiedImageError,
)

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.float_files import BROKEN, check_size, read_light, read_tiff
from downstream_hpe.prediction.kinds import (
    DRAWN_PICTURES,
    HEADER,
    instead,
    is_avif,
    is_float,
    is_heif,
    is_tiff,
)
from downstream_hpe.prediction.modes import reduced_rgb, rgb_of_mode
from downstream_hpe.reading import check_regular

FORMATS = ("JPEG", "PNG", "BMP", "DIB", "WEBP", "TIFF", "GIF", "PPM", "AVIF", "HEIF")
"""Those of the endings that count as pictures. JPEG 2000 is none: its decoders have been attacked."""
MAX_BYTES = 1 << 30
MAX_PIXELS = 1 << 26
"""8192 x 8192; three times as many bytes, twice over, while it is turned upright."""
MAX_REDUCED_PIXELS = 1 << 28
"""16,384 x 16,384, of what LARGE reads, at half of its size or less. Until it is made smaller it takes a
gigabyte; a JPEG less, which is made smaller while it is decoded: benchmarks/large_pictures.py."""
LARGE: tuple[type[ImageFile.ImageFile], ...] = (
    JpegImagePlugin.JpegImageFile,
    PngImagePlugin.PngImageFile,
    TiffImagePlugin.TiffImageFile,
    BmpImagePlugin.BmpImageFile,
    PpmImagePlugin.PpmImageFile,
)
"""Readers that decode line by line, into the picture itself. Others hold all of it two or three times."""
_UPRIGHT = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""What makes a picture upright, by the EXIF tag Orientation."""
ON_ITS_SIDE = frozenset(_UPRIGHT[orientation] for orientation in (5, 6, 7, 8))
"""Those that swap its width and height."""
_ORIENTATION = 0x0112
_WIDTH, _HEIGHT, _BITS, _PHOTOMETRIC, _PLANES = 256, 257, 258, 262, 284
"""Tags of TIFF: its size, bits of a channel, what its numbers mean, where its channels lie."""
_WHITE_IS_ZERO, _APART = 0, 2

File = Path | io.BytesIO
"""Where a picture lies; what came through a pipe or from an address is in memory."""


@dataclass(frozen=True)
class Picture:
    """bgr: uint8 [H, W, 3], BGR, upright. reduced: how many times smaller than in the file it is."""

    bgr: np.ndarray
    reduced: float = 1.0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in the file."""
        height, width = self.bgr.shape[:2]
        return round(width * self.reduced), round(height * self.reduced)


def read_bgr(path: Path) -> np.ndarray:
    """uint8 [H, W, 3], BGR, upright, of the size that it has in the file; what is transparent shows the
    colour that lies under it.

    DataError: no picture, not of FORMATS, or of more than MAX_PIXELS, by its header.
    """
    return _picture(path, str(path), MAX_PIXELS).bgr


def read_picture(file: File, name: str | None = None) -> Picture:
    """As :func:`read_bgr`; what LARGE reads may have MAX_REDUCED_PIXELS: it is read reduced where it has more
    than MAX_PIXELS. name: of what is no file."""
    return _picture(file, str(file) if isinstance(file, Path) else name or "-", MAX_REDUCED_PIXELS)


def _picture(file: File, name: str, limit: int) -> Picture:
    """name: as messages call it. limit: pixels of what LARGE reads."""
    try:
        start = _start(file)
        if isinstance(file, Path) and is_float(start):
            return Picture(read_light(file, MAX_PIXELS)[..., ::-1])
        # Opened here: Pillow maps what it opens itself, and then garbles a TIFF that lies on its side.
        opened = file.open("rb") if isinstance(file, Path) else contextlib.nullcontext(file)
        with quiet_warnings(), opened as content:
            return _read(content, name, limit)
    except FileNotFoundError as error:
        raise DataError(f"{name}: there is no such picture") from error
    except UnidentifiedImageError as error:
        if isinstance(file, Path) and is_tiff(start):
            values, orientation = read_tiff(file, MAX_PIXELS)
            return Picture(bgr_turned(Image.fromarray(values), _UPRIGHT.get(orientation)))
        raise DataError(f"{name}: not a readable picture{_missing(start)}") from error
    # Pillow raises what it likes at damaged files.
    except BROKEN as error:
        cut = "; it is cut off" if "truncated" in str(error) else ""
        raise DataError(f"{name}: not a readable picture{cut}") from error


@contextlib.contextmanager
def quiet_warnings() -> Iterator[None]:
    """What Pillow thinks of metadata and sizes is kept from the terminal: limits are our own."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def formats() -> tuple[str, ...]:
    """Those of FORMATS that this Pillow reads, with pillow-heif where it is installed."""
    Image.init()
    has_heif()
    return tuple(name for name in FORMATS if name in Image.OPEN)


def write_bgr(bgr: np.ndarray, path: Path) -> None:
    """uint8 [H, W, 3] to a file, by its suffix; its folder is made. DataError where that fails."""
    if path.suffix.lower() not in DRAWN_PICTURES:
        raise ValueError(f"{path}: expected one of {' '.join(DRAWN_PICTURES)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # The quality is that of a JPEG; lossy colours would fray the lines.
        Image.fromarray(np.ascontiguousarray(bgr[..., ::-1])).save(path, quality=95)
    # A WebP has at most 16,383 pixels in a line, a JPEG 65,535.
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from error


def _start(file: File) -> bytes:
    if isinstance(file, io.BytesIO):
        return file.getvalue()[:HEADER]
    check_regular(file, MAX_BYTES)
    with file.open("rb") as opened:
        return opened.read(HEADER)


def _read(content: BinaryIO, name: str, limit: int) -> Picture:
    # Closed, which frees its pixels, before those of RGB are copied once more.
    with contextlib.closing(_opened(content, name)) as image:
        width, height = image.size
        check_size(name, width, height, limit if isinstance(image, LARGE) else MAX_PIXELS)
        if isinstance(image, TiffImagePlugin.TiffImageFile) and _beyond_pillow(image):
            raise UnidentifiedImageError
        step = _step(width, height)
        if step > 1 and isinstance(image, JpegImagePlugin.JpegImageFile):
            image.draft(None, (width // step, height // step))
            step = _step(*image.size)
        rgb = rgb_of_mode(image) if step == 1 else reduced_rgb(image, step)
        # Only now: while it is decoded, Pillow itself turns a TIFF.
        turn = turn_upright(image)
    return Picture(bgr_turned(rgb, turn), max(width, height) / max(rgb.size))


class _LargeTiff(TiffImagePlugin.TiffImageFile):
    """Without Pillow's own limit, which it asks for once more."""

    def load_prepare(self) -> None:
        """Make room for the pixels as they lie in the file."""
        self.im = Image.new(self.mode, (self.tag_v2[_WIDTH], self.tag_v2[_HEIGHT])).im
        super().load_prepare()


def _opened(content: BinaryIO, name: str) -> Image.Image:
    # Pillow's own limit is the same for what is read reduced.
    with contextlib.suppress(Image.DecompressionBombError):
        return Image.open(content, formats=formats())
    for reader in LARGE:
        content.seek(0)
        with contextlib.suppress(SyntaxError):  # another format
            return _LargeTiff(content) if reader is TiffImagePlugin.TiffImageFile else reader(content)
    raise DataError(f"{name}: a picture of more than {MAX_PIXELS:,} pixels; make it smaller")


def turn_upright(image: Image.Image) -> Image.Transpose | None:
    """What makes a picture that was decoded upright, as its EXIF says."""
    orientation = image.getexif().get(_ORIENTATION)
    return _UPRIGHT.get(orientation) if isinstance(orientation, int) else None


def bgr_turned(rgb: Image.Image, turn: Image.Transpose | None) -> np.ndarray:
    """uint8 [H, W, 3], BGR, of a picture that is turned so."""
    return np.asarray(rgb if turn is None else rgb.transpose(turn))[..., ::-1]


def _beyond_pillow(image: TiffImagePlugin.TiffImageFile) -> bool:
    """Whether it is one of those that Pillow reads wrongly: more than 8 bits a channel, of colours each on a
    plane of its own, or with white as zero."""
    tags = image.tag_v2
    deep = max(tags.get(_BITS, (1,))) > 8
    return deep and (tags.get(_PLANES) == _APART or tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO)


def _step(width: int, height: int) -> int:
    """How many times smaller a picture is read: as much as it takes, and as a JPEG can be decoded."""
    step = 1
    while (width // step) * (height // step) > MAX_PIXELS:
        step *= 2
    return step


@cache
def has_heif() -> bool:
    """Whether pillow-heif is installed; Pillow knows it then."""
    try:
        import pillow_heif
    except ImportError:
        return False
    pillow_heif.register_heif_opener()
    return True


def _missing(start: bytes) -> str:
    """What is wrong with a file that begins like this, or what to install to read it."""
    if plainly := instead(start):
        return plainly
    if is_heif(start) and not has_heif():
        return "; HEIC is read where pillow-heif is: pip install pillow-heif"
    if is_avif(start) and "AVIF" not in Image.OPEN:
        return "; AVIF is read where Pillow is newer: pip install 'pillow>=11.3'"
    return ""

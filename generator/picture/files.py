# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramas and pictures on disk: which there are, and what is in them, read with limits."""

from __future__ import annotations

import io
import re
import shutil
import warnings
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from generator.errors import UsageError
from generator.escape import shortened
from generator.exr_header import check_exr
from generator.process import native_silence
from generator.reading import read_limited

PANORAMAS, PICTURES = (".exr", ".hdr"), (".png", ".jpg", ".jpeg")
"""Suffixes."""

MAX_FILES = 2000
"""In a folder: their names are recorded."""

MAX_BYTES = 1 << 28
MAX_SIDE = 8192
MAX_PIXELS = 1 << 25

WIDE = 1024
"""Pixels across to which larger panoramas are averaged."""

_ALL_COMPRESSIONS = range(10)
_SIZE = re.compile(rb"\n[-+][XY] (\d{1,9}) [-+][XY] (\d{1,9})\n")
"""Of a Radiance picture (.hdr)."""


def packaged_panoramas() -> Path:
    """The folder of the panoramas that come with Blender, CC0: of the bpy wheel, or of a Blender on the PATH.

    Raises UsageError if there is none.
    """
    found = find_spec("bpy")
    roots = [Path(place) for place in (found.submodule_search_locations or ()) if found] if found else []
    if executable := shutil.which("blender"):
        roots.append(Path(executable).resolve().parent)
    for root in roots:
        for folder in sorted(root.glob("*/datafiles/studiolights/world")):
            return folder
    raise UsageError("render.environment: no panoramas of Blender are here; name a folder in --environments")


def named_files(folder: Path, suffixes: tuple[str, ...], what: str) -> dict[str, Path]:
    """The files of a folder by their names, sorted. Panoramas and things are named without their suffix.

    what: the setting, for messages. Raises UsageError: no folder, none in it, too many, or a name that cannot
    stand in a choice.
    """
    try:
        every = sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes)
    except OSError as error:
        raise UsageError(f"{what}: {folder}: {error.strerror}; give a folder of {_list(suffixes)}") from error
    if not every:
        raise UsageError(f"{what}: {folder}: no {_list(suffixes)} is in it")
    if len(every) > MAX_FILES:
        raise UsageError(f"{what}: {folder}: has {len(every)} files, more than {MAX_FILES}; give fewer")
    files: dict[str, Path] = {}
    for path in every:
        name = path.name if suffixes == PICTURES else path.stem
        if not name.isprintable() or set(name) & set(",:;"):
            raise UsageError(f"{what}: {shortened(repr(str(path)))}: rename it without commas and colons")
        if name in files:
            raise UsageError(f"{what}: {path}: {files[name].name} has the same name; rename one")
        files[name] = path
    return files


def read_file(path: Path, what: str) -> bytes:
    """The bytes of one. Raises UsageError: not a regular file, too large, empty, or not readable."""
    try:
        data = read_limited(path, MAX_BYTES)
    except OSError as error:
        raise UsageError(f"{what}: {path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise UsageError(f"{what}: {path}: {error}; make it smaller") from error
    if not data:
        raise UsageError(f"{what}: {path}: is empty; expected an image")
    return data


def read_panorama(path: Path) -> np.ndarray:
    """A panorama in linear light, float32 [H, W, 3], at most WIDE pixels across.

    Raises UsageError: no image, too large, not as wide as a panorama, or without light.
    """
    data = read_file(path, "render.environment")
    try:
        image = _exr(path) if path.suffix.lower() == ".exr" else _radiance(data)
    # The libraries raise what they like at a damaged file.
    except (OSError, RuntimeError, ValueError, TypeError, LookupError, ArithmeticError, cv2.error) as error:
        reason = shortened(" ".join(str(error).split()))
        raise UsageError(f"render.environment: {path}: not a readable panorama ({reason})") from error
    height, width = image.shape[:2]
    if abs(width - 2 * height) > 2:
        raise UsageError(
            f"render.environment: {path}: {width} x {height} pixels, expected twice as wide as high"
        )
    image = np.maximum(np.nan_to_num(image, nan=0.0, posinf=65504.0, neginf=0.0), 0)
    if not image.any():
        raise UsageError(f"render.environment: {path}: is black and gives no light")
    if width > WIDE:
        image = cv2.resize(image, (WIDE, WIDE // 2), interpolation=cv2.INTER_AREA)
    return image


def read_picture(path: Path) -> np.ndarray:
    """A picture, uint8 [H, W, 3], RGB in sRGB. Raises UsageError: no picture, or too large."""
    data = read_file(path, "render.pictures")
    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        try:
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise ValueError(f"more than {MAX_PIXELS:,} pixels")
                return np.asarray(image.convert("RGB"))
        except (OSError, ValueError, SyntaxError, ArithmeticError, LookupError, Warning) as error:
            reason = shortened(" ".join(str(error).split()))
            raise UsageError(f"render.pictures: {path}: not a readable picture ({reason})") from error


def _exr(path: Path) -> np.ndarray:
    import OpenEXR

    check_exr(path, max_side=MAX_SIDE, compressions=_ALL_COMPRESSIONS, max_bytes=16 * MAX_PIXELS)
    with native_silence(1, 2), OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: np.array(found.pixels) for name, found in file.parts[0].channels.items()}
    if not {"R", "G", "B"} <= set(channels):
        raise ValueError("it has no channels R, G and B")
    return np.stack([channels[name].astype(np.float32) for name in "RGB"], axis=-1)


def _radiance(data: bytes) -> np.ndarray:
    size = _SIZE.search(data[: 1 << 16])
    if not data.startswith(b"#?") or size is None:
        raise ValueError("no Radiance picture")
    if not 0 < int(size[1]) * int(size[2]) <= MAX_PIXELS:
        raise ValueError(f"more than {MAX_PIXELS:,} pixels")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 3:
        raise ValueError("it cannot be decoded")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.float32)


def _list(suffixes: tuple[str, ...]) -> str:
    return " or ".join(suffixes)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The header of an OpenEXR file, walked before its library decodes it: what it says it holds.

OpenEXR, 2007-2023, "File Layout": magic, version, then attributes (name, type, size, value) up to an
empty name; a file of parts has a list of attributes a part, up to an empty one.
"""

from __future__ import annotations

import struct
from collections.abc import Collection
from pathlib import Path

from generator.reading import check_regular

MAX_FILE_BYTES = 1 << 30
MAX_HEADER_BYTES = 1 << 20
MAX_SIDE = 4096
"""The largest resolution that a build takes."""

MAX_PARTS, MAX_CHANNELS = 32, 64
_MAGIC = b"\x76\x2f\x31\x01"
_LONG_NAMES, _PARTS = 0x400, 0x1000
_COMPRESSIONS = (0, 1, 2, 3)
"""None, runs, and zlib by a line or by sixteen: what Blender and this program write."""
_WIDTHS = {0: 4, 1: 2, 2: 4}
_ZLIB_RATIO, _SLACK = 1040, 1 << 16
"""zlib packs no better."""


def check_exr(
    path: Path,
    *,
    max_side: int = MAX_SIDE,
    compressions: Collection[int] = _COMPRESSIONS,
    max_bytes: int = 1 << 40,
) -> None:
    """Is it an image of lines, of a sane size, with a header that can be read?

    max_bytes: of its pixels, unpacked.

    Raises
    ------
    OSError: no regular file, or it cannot be read. ValueError: it is not, with the reason.
    """
    size = check_regular(path, MAX_FILE_BYTES)
    with path.open("rb") as file:
        data = file.read(MAX_HEADER_BYTES)
    if data[:4] != _MAGIC:
        raise ValueError("no OpenEXR")
    flags = int.from_bytes(data[4:8], "little")
    if flags & 0xFF != 2 or flags & ~(0xFF | _LONG_NAMES | _PARTS):
        raise ValueError("tiles, or samples at depths, which no passes have")
    at, parts = 8, 0
    while True:
        attributes, at = _attributes(data, at)
        if not attributes and flags & _PARTS and parts:
            return
        parts += 1
        if parts > MAX_PARTS:
            raise ValueError(f"more than {MAX_PARTS} parts")
        _check_part(attributes, size, max_side, compressions, max_bytes)
        if not flags & _PARTS:
            return


def _attributes(data: bytes, at: int) -> tuple[dict[str, bytes], int]:
    """Values by name, and where the list ends."""
    found: dict[str, bytes] = {}
    while True:
        name, at = _text(data, at)
        if not name:
            return found, at
        kind, at = _text(data, at)
        if at + 4 > len(data):
            raise ValueError("its header is cut off")
        size = struct.unpack_from("<i", data, at)[0]
        at += 4
        if not 0 <= size <= len(data) - at:
            raise ValueError(f"the attribute {name!r} in its header is larger than the header")
        value = data[at : at + size]
        if kind == "string":
            value.decode("utf-8")
        if name in found:
            raise ValueError(f"the attribute {name!r} is in its header twice")
        found[name] = value
        at += size


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("its header is cut off")
    text = data[at:end].decode("utf-8")
    if not text.isprintable():
        raise ValueError("a name in its header cannot be printed")
    return text, end + 1


def _check_part(
    attributes: dict[str, bytes], size: int, max_side: int, compressions: Collection[int], max_bytes: int
) -> None:
    try:
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
        [compression] = struct.unpack("<B", attributes["compression"])
        channels = attributes["channels"]
    except (KeyError, struct.error) as error:
        raise ValueError("its header lacks what every OpenEXR has") from error
    width, height = right - left + 1, bottom - top + 1
    if not (1 <= width <= max_side and 1 <= height <= max_side):
        raise ValueError(f"{width} x {height} pixels, expected 1 to {max_side} a side")
    if compression not in compressions:
        raise ValueError("a compression that no passes have")
    count, stored = 0, 0
    at = 0
    while True:
        name, at = _text(channels, at)
        if not name:
            break
        if at + 16 > len(channels):
            raise ValueError("its channels are cut off")
        kind, _, across, down = struct.unpack_from("<4i", channels, at)
        at += 16
        if kind not in _WIDTHS or (across, down) != (1, 1):
            raise ValueError(f"the channel {name!r} is of a kind that no passes have")
        count, stored = count + 1, stored + _WIDTHS[kind] * width * height
    if not 1 <= count <= MAX_CHANNELS or at != len(channels):
        raise ValueError(f"{count} channels, expected 1 to {MAX_CHANNELS}")
    if stored > max_bytes:
        raise ValueError("more pixels than such a file may have")
    if stored > _ZLIB_RATIO * size + _SLACK:
        raise ValueError("fewer bytes than its pixels need")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted textures as PNG, quickly.

Grain leaves nothing that repeats: looking for it, and for the best filter of every row as Pillow does, takes
three times as long for a tenth of the size. Each row is told by its difference from the one above.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

_UP = 2  # PNG specification (ISO/IEC 15948), 9.2
_COLOR_TYPES = {3: 2, 4: 6}  # of so many channels


def png_bytes(pixels: np.ndarray) -> bytes:
    """uint8 [H, W, 3], or 4 with alpha, as a PNG file without any metadata."""
    height, width, channels = pixels.shape
    rows = pixels.reshape(height, width * channels)
    lines = np.empty((height, 1 + width * channels), dtype=np.uint8)
    lines[:, 0] = _UP
    lines[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=lines[1:, 1:])
    packer = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_HUFFMAN_ONLY)
    header = struct.pack(">IIBBBBB", width, height, 8, _COLOR_TYPES[channels], 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", packer.compress(lines.data) + packer.flush()), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

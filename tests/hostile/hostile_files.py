# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that nobody wrote by accident, each made where it is needed: they are small."""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

DEEP = 200_000
JP2 = b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\x14ftypjp2 \0\0\0\0jp2 " + bytes(64)


def png(width: int, height: int) -> bytes:
    """A whole PNG, black, a bit a pixel: 20,000 x 20,000 in 50 kB."""
    rows = zlib.compressobj(9)
    line = b"\0" * (1 + (width + 7) // 8)
    data = b"".join(rows.compress(line) for _ in range(height)) + rows.flush()
    chunks = ((b"IHDR", struct.pack(">2I5B", width, height, 1, 0, 0, 0, 0)), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


def fifo(path: Path) -> None:
    """A pipe that nobody writes to."""
    os.mkfifo(path)


def endless(path: Path) -> None:
    """A link to a file without an end."""
    path.symlink_to("/dev/zero")


NO_FILES = {"fifo": fifo, "endless": endless}


class Fbx:
    """Puts records into a file: their ends are counted from its start."""

    def __init__(self) -> None:
        self.data = bytearray(b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400))

    def record(self, name: str, *values: bytes, children: Sequence[tuple] = ()) -> None:
        """children: (name, values, children)."""
        start = len(self.data)
        properties = b"".join(values)
        self.data += bytes(13) + name.encode() + properties
        for child, its, below in children:
            self.record(child, *its, children=below)
        if children:
            self.data += bytes(13)
        header = struct.pack("<3IB", len(self.data), len(values), len(properties), len(name))
        self.data[start : start + 13] = header

    def whole(self) -> bytes:
        """The file."""
        return bytes(self.data) + bytes(13)


def fbx_text(text: str | bytes, kind: bytes = b"S") -> bytes:
    """A property of text, or of bytes."""
    data = text.encode() if isinstance(text, str) else text
    return kind + struct.pack("<I", len(data)) + data


def fbx_array(values: bytes, claimed: int, encoding: int) -> bytes:
    """A property of float64: how many it claims, and the bytes as they are stored."""
    return b"d" + struct.pack("<3I", claimed, encoding, len(values)) + values


def fbx(name: str = "", content: bytes = b"", key: str = "RelativeFilename", materials: int = 1) -> bytes:
    """An FBX with one picture of that name, embedded if there is content."""
    file = Fbx()
    below = [(key, (fbx_text(name),), ())] if name else []
    if content:
        below.append(("Content", (fbx_text(content, b"R"),), ()))
    identity = (b"L" + bytes(8), fbx_text(b"skin\0\1Video"), fbx_text("Clip"))
    objects = [("Material", (b"L" + bytes(8),), ())] * materials
    file.record("Objects", children=[*objects, ("Video", identity, below)])
    return file.whole()


def npz(**arrays: np.ndarray) -> bytes:
    """An archive of arrays, compressed."""
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def npz_of(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of raw members."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def npy_header(shape: tuple[int, ...], kind: str = "|u1") -> bytes:
    """The header of an array, without its values."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text

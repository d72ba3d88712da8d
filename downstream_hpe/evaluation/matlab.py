# SPDX-License-Identifier: MIT
"""Arrays of numbers of a MATLAB 5 file: the part of the format that labels need.

scipy reads all of it, with code that a damaged file can crash. Format: "MAT-File Format", MathWorks:
a header of 128 bytes, then elements (type, size, data), most of them compressed with zlib.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from downstream_hpe.reading import read_limited

MAX_BYTES = 1 << 26
MAX_VALUES = 1 << 20
"""Of an array that is read."""

_HEADER = 128
_COMPRESSED, _MATRIX, _UINT32, _INT32, _INT8 = 15, 14, 6, 5, 1
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_NUMERIC = range(6, 16)
"""Classes of matrices: double to uint64."""
_COMPLEX = 0x800
_PEEK = 1 << 10
"""Type, flags, shape and name of a matrix lie in so many bytes."""


def read_arrays(path: Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Those of the arrays that the file has, float64, of the shape they have in MATLAB.

    Raises
    ------
    OSError: no regular file, or it cannot be read. ValueError: no MATLAB 5 file, damaged, or an array
        that is wanted is none of numbers, or larger than MAX_VALUES.
    """
    data = read_limited(path, MAX_BYTES)
    mark = data[126:128]
    if len(data) < _HEADER or mark not in (b"IM", b"MI") or b"\0" in data[:4]:
        raise ValueError("no MATLAB 5 file")
    order = "<" if mark == b"IM" else ">"
    if struct.unpack(f"{order}H", data[124:126])[0] != 0x0100:
        raise ValueError("no MATLAB 5 file; save it with -v7, not -v7.3")
    found: dict[str, np.ndarray] = {}
    for kind, body in _elements(memoryview(data)[_HEADER:], order):
        if kind == _COMPRESSED:
            body = _unpacked(body, order, names)
        elif kind != _MATRIX:
            continue
        name, array = _matrix(body, order, names)
        if array is not None:
            found[name] = array
    return found


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """(type, data) one after the other."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}2I", data, at)
        if kind >> 16:  # a small one: size and type share four bytes, the data are in the next four
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise ValueError("a small element is not small")
            yield kind, data[at + 4 : at + 4 + size]
            at += 8
            continue
        at += 8
        if size > len(data) - at:
            raise ValueError("cut off")
        yield kind, data[at : at + size]
        at += size if kind == _COMPRESSED else -(-size // 8) * 8


def _unpacked(packed: memoryview, order: str, names: Collection[str]) -> memoryview:
    """The matrix in a compressed element: whole if it is wanted, else its beginning."""
    unpacker = zlib.decompressobj()
    try:
        start = unpacker.decompress(packed, _PEEK)
        if len(start) < 8:
            raise ValueError("cut off")
        kind, size = struct.unpack_from(f"{order}2I", start)
        if kind != _MATRIX:
            return memoryview(b"")
        body = memoryview(start)[8:]
        name, _ = _matrix(body, order, ())
        if name not in names:
            return body
        if size > 16 * MAX_VALUES:
            raise ValueError(f"{name} is too large")
        rest = unpacker.decompress(unpacker.unconsumed_tail, max(1, size - len(body)))
    except zlib.error as error:
        raise ValueError("damaged") from error
    whole = (bytes(body) + rest)[:size]
    if len(whole) < size:
        raise ValueError("cut off")
    return memoryview(whole)


def _matrix(body: memoryview, order: str, names: Collection[str]) -> tuple[str, np.ndarray | None]:
    """The name of a matrix, and its numbers where it is wanted."""
    parts = _elements(body, order)
    try:
        (kind, flags), (_, sizes), (_, name) = next(parts), next(parts), next(parts)
    except StopIteration:
        return "", None
    text = bytes(name).decode("latin-1")
    if text not in names:
        return text, None
    if kind != _UINT32 or len(flags) < 8 or len(sizes) % 4:
        raise ValueError("damaged")
    word = struct.unpack_from(f"{order}I", flags)[0]
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    count = math.prod(shape)
    if word & 0xFF not in _NUMERIC or word & _COMPLEX:
        raise ValueError(f"{text} is no array of real numbers")
    if not 2 <= len(shape) <= 8 or min(shape) < 0 or count > MAX_VALUES:
        raise ValueError(f"{text} has a shape that it cannot have")
    stored, values = next(parts, (0, memoryview(b"")))
    if stored not in _NUMBERS:
        raise ValueError(f"{text} is no array of real numbers")
    kind_of = np.dtype(order + _NUMBERS[stored])
    if len(values) != count * kind_of.itemsize:
        raise ValueError(f"{text} has fewer numbers than it says")
    return text, np.frombuffer(values, kind_of).astype(np.float64).reshape(shape, order="F")

# SPDX-License-Identifier: MIT
"""Arrays of an .npz file, from a stranger: sizes are compared before anything is unpacked."""

from __future__ import annotations

import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from downstream_hpe.reading import check_regular

MAX_BYTES = 1 << 34
"""Of the file; BIWI as FSA-Net packs it has a fifth of that."""
MAX_RATIO = 50
MAX_SMALL = 1 << 26
"""An array may unpack to the second, or else to so many times what is stored of it."""
MAX_MEMBERS = 64
_FAULTS = (
    ValueError, TypeError, AttributeError, LookupError, EOFError, NotImplementedError, RuntimeError,
    SyntaxError, MemoryError, RecursionError, ArithmeticError, zipfile.BadZipFile, zlib.error,
    struct.error, tokenize.TokenError,
)  # fmt: skip
"""What numpy and zipfile raise at a damaged archive, an encrypted one, or an unknown compression."""


def read_npz(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """The named arrays, or all of them. Never unpickles.

    Raises
    ------
    OSError: no regular file, or it cannot be read. ValueError: no such archive, damaged, encrypted, an
        array is missing or of objects, or would unpack to much more than is stored.
    """
    size = check_regular(path, MAX_BYTES)
    try:
        with zipfile.ZipFile(path) as archive:
            members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
            if len(members) > MAX_MEMBERS:
                raise ValueError(f"more than {MAX_MEMBERS} arrays")
            wanted = {info.filename.removesuffix(".npy"): info for info in members}
            if names is not None:
                wanted = {name: wanted[name] for name in names}
            return {name: _array(archive, info, size) for name, info in wanted.items()}
    except OSError:
        raise
    except _FAULTS as error:
        what = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(what[:100]) from error


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, size_of_file: int) -> np.ndarray:
    allowed = max(MAX_SMALL, MAX_RATIO * min(info.compress_size, size_of_file))
    if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("it is encrypted, or packed as numpy packs nothing")
    with archive.open(info) as stream:
        if np.lib.format.read_magic(stream) != (1, 0):  # others may have a header of 4 GB
            raise ValueError("an array in a format that numpy does not write for it")
        shape, by_column, kind = np.lib.format.read_array_header_1_0(stream)
        if kind.hasobject or kind.itemsize == 0 or min(shape, default=0) < 0:
            raise ValueError("an array of objects, or of a shape that none has")
        size = math.prod(shape) * kind.itemsize
        if size > allowed:
            raise ValueError(f"{info.filename} unpacks to {size:,} bytes, more than {allowed:,}")
        data = stream.read(size)
    if len(data) < size:
        raise ValueError(f"{info.filename} is cut off")
    return np.frombuffer(data, kind).reshape(shape, order="F" if by_column else "C")

# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of a glTF: buffers, views into them, accessors that are strided, sparse or quantized."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from generator.heads.gltf_file import COMPONENTS, uri_bytes

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


class Accessors:
    """The accessors of a file that :func:`generator.heads.gltf_file.check_header` found to be of a sane size.

    As the kinds of values in the JSON are anybody's, its methods raise LookupError, TypeError or
    ValueError for what is malformed, HeadError for a buffer that cannot be read.
    """

    def __init__(self, header: dict[str, Any], binary: bytes, folder: Path) -> None:
        self._header, self._binary, self._folder = header, binary, folder
        self._buffers: dict[int, bytes] = {}

    def count(self, index: int) -> int:
        """How many elements an accessor has, without reading one."""
        return int(self._header["accessors"][index]["count"])

    def values(self, index: int) -> np.ndarray:
        """As they are stored: [count, components]."""
        accessor = self._header["accessors"][index]
        count, kind = int(accessor["count"]), np.dtype(_TYPES[accessor["componentType"]])
        shape = (count, COMPONENTS[accessor["type"]])
        stored = self._rows(accessor, shape, kind) if "bufferView" in accessor else np.zeros(shape, kind)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            changed = min(int(sparse["count"]), count)
            where_kind = np.dtype(_TYPES[sparse["indices"]["componentType"]])
            stored = stored.copy()
            where = self._rows(sparse["indices"], (changed, 1), where_kind)[:, 0]
            stored[where] = self._rows(sparse["values"], (changed, shape[1]), kind)
        return stored

    def numbers(self, index: int) -> np.ndarray:
        """float [count, components]: float32 as stored, integers as what they stand for (glTF 2.0, 3.11)."""
        stored = self.values(index)
        if stored.dtype.kind == "f":
            return stored
        if not self._header["accessors"][index].get("normalized", False):
            return stored.astype(np.float32)
        return np.maximum(stored.astype(np.float32) / np.iinfo(stored.dtype).max, -1.0)

    def view_bytes(self, index: int) -> bytes:
        """What a view holds."""
        view = self._header["bufferViews"][index]
        buffer = self._buffer(view["buffer"])
        start, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        if not 0 <= start <= start + length <= len(buffer):
            raise ValueError("a view lies outside of its buffer")
        return buffer[start : start + length]

    def _rows(self, place: dict[str, Any], shape: tuple[int, int], kind: np.dtype[Any]) -> np.ndarray:
        view = self._header["bufferViews"][place["bufferView"]]
        start = int(view.get("byteOffset", 0)) + int(place.get("byteOffset", 0))
        stride = int(view.get("byteStride", kind.itemsize * shape[1]))
        if start < 0 or stride < kind.itemsize:
            raise ValueError("an accessor lies outside of its buffer")
        if shape[0] == 0:
            return np.zeros(shape, kind)
        # numpy refuses what does not lie in the buffer.
        return np.ndarray(shape, kind, self._buffer(view["buffer"]), start, (stride, kind.itemsize))

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self._header["buffers"][index].get("uri")
            self._buffers[index] = self._binary if uri is None else uri_bytes(uri, self._folder)
        return self._buffers[index]

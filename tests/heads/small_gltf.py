# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF files of a few triangles, put together value by value."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0]], np.float32)
UV = np.array([[0, 0], [1, 0], [1, 1]], np.float32)
_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def image_uri(color: tuple[int, ...], kind: str = "PNG") -> str:
    """An image of 4 x 4 pixels of one colour."""
    file = io.BytesIO()
    Image.new("RGBA" if len(color) == 4 else "RGB", (4, 4), color).save(file, kind)
    return data_uri(f"image/{kind.lower()}", file.getvalue())


class SmallGltf:
    """header: its JSON, to be completed. A scene of all nodes that are nobody's child is added by write."""

    def __init__(self) -> None:
        self.header: dict[str, Any] = {"asset": {"version": "2.0"}, "meshes": [], "nodes": []}
        self.header |= {"accessors": [], "bufferViews": []}
        self._data = b""

    def view(self, values: np.ndarray) -> int:
        data = np.ascontiguousarray(values).tobytes()
        place = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data += data + bytes(-len(data) % 4)
        self.header["bufferViews"].append(place)
        return len(self.header["bufferViews"]) - 1

    def accessor(self, values: np.ndarray, **more: Any) -> int:
        values = np.atleast_2d(values.T).T
        entry = {"bufferView": self.view(values), "componentType": _COMPONENTS[values.dtype.str[1:]]}
        entry |= {"count": len(values), "type": _TYPES[values.shape[1]]}
        self.header["accessors"].append(entry | more)
        return len(self.header["accessors"]) - 1

    def triangle(self, attributes: dict[str, int] | None = None, **more: Any) -> int:
        """A mesh of one primitive, with CORNERS and UV where attributes do not say other."""
        attributes = {} if attributes is None else attributes
        if "POSITION" not in attributes:
            attributes = {"POSITION": self.accessor(CORNERS), "TEXCOORD_0": self.accessor(UV), **attributes}
        self.header["meshes"].append({"primitives": [{"attributes": attributes, **more}]})
        return len(self.header["meshes"]) - 1

    def bound(self, joints: list[int], weights: list[float]) -> dict[str, int]:
        """Attributes that bind each of three corners to the same joints."""
        return {
            "JOINTS_0": self.accessor(np.tile(np.array(joints, np.uint8), (3, 1))),
            "WEIGHTS_0": self.accessor(np.tile(np.array(weights, np.float32), (3, 1))),
        }

    def node(self, **values: Any) -> int:
        self.header["nodes"].append(values)
        return len(self.header["nodes"]) - 1

    def write(self, path: Path) -> Path:
        nodes = self.header["nodes"]
        children = {child for node in nodes for child in node.get("children", ())}
        roots = [index for index in range(len(nodes)) if index not in children]
        whole = {"scene": 0, "scenes": [{"nodes": roots}], **self.header}
        whole["buffers"] = [{"byteLength": len(self._data), "uri": data_uri("x/y", self._data)}]
        path.write_text(json.dumps(whole))
        return path

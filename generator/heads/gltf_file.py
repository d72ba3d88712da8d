# SPDX-License-Identifier: GPL-3.0-or-later
"""The container of a glTF: its JSON, its bytes, and whether both are of a size that can be unpacked."""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import (
    MAX_DEPTH,
    MAX_GEOMETRY_BYTES,
    MAX_MATERIALS,
    MAX_NODES,
    check_count,
    read_mesh_bytes,
)
from generator.heads.paths import find_inside
from generator.reading import parse_json

MAX_JSON_VALUES = 2_000_000
"""A JSON takes about a hundred bytes of memory a value."""
MAGIC, JSON, BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_KNOWN = (
    *("KHR_materials_", "KHR_texture_transform", "KHR_mesh_quantization", "EXT_texture_webp"),
    *("KHR_lights_punctual", "KHR_node_visibility", "KHR_draco_mesh_compression", "VRM"),
)
"""How the names of extensions begin that are read, or that change nothing of a mesh and its colours."""


def split_gltf(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk (empty for .gltf) of a file.

    Raises
    ------
    HeadError: neither kind of glTF, or version 1.
    """
    data = read_mesh_bytes(path)
    binary = b""
    try:
        if data[:4] == b"glTF":
            _, version, _, length, kind = struct.unpack_from("<5I", data)
            text, rest = data[20 : 20 + length], data[20 + length :]
            if kind != JSON or len(text) != length or version != 2:
                raise ValueError("broken container")
            if rest:
                length, kind = struct.unpack_from("<2I", rest)
                binary = rest[8 : 8 + length]
                if len(binary) != length:
                    raise ValueError("truncated")
        else:
            text = data
        check_count(text.count(b","), MAX_JSON_VALUES, "values in its JSON")
        header = parse_json(text)
        if not isinstance(header, dict) or not str(header["asset"]["version"]).startswith("2"):
            raise ValueError("not version 2")
    except (ValueError, KeyError, TypeError, struct.error) as error:
        raise HeadError(f"not a glTF 2.0 file ({error}); export it again") from error
    return header, binary


def check_header(header: dict[str, Any]) -> None:
    """Raises HeadError: it needs an extension, or claims more than a head may have. As the kinds of its
    values are anybody's, also LookupError, TypeError, AttributeError or ValueError."""
    unknown = [e for e in header.get("extensionsRequired", []) if not str(e).startswith(_KNOWN)]
    if unknown:
        raise HeadError(f"the file needs {quoted(', '.join(map(str, unknown)))}; export it without")
    nodes = header.get("nodes", [])
    check_count(len(header.get("materials", [])), MAX_MATERIALS, "materials")
    check_count(len(nodes), MAX_NODES, "nodes")
    primitives = sum(len(mesh["primitives"]) for mesh in header.get("meshes", []))
    check_count(primitives, MAX_NODES, "pieces of meshes")
    _check_sizes(header)
    _check_tree(nodes)


def _check_sizes(header: dict[str, Any]) -> None:
    """What accessors claim may be many times what the file holds: they may share bytes, or have none."""
    size = sum(max(0, int(view["byteLength"])) for view in header.get("bufferViews", []))
    for accessor in header.get("accessors", []):
        if accessor["count"] < 0:
            raise HeadError("the file claims a negative number of elements; export it again")
        size += int(accessor["count"]) * COMPONENTS[accessor["type"]] * _SIZES[accessor["componentType"]]
    if size > MAX_GEOMETRY_BYTES:
        raise HeadError(f"the file claims {size:,} bytes of geometry; {MAX_GEOMETRY_BYTES:,} is the limit")


def _check_tree(nodes: list[dict[str, Any]]) -> None:
    parents: dict[int, int] = {}
    for index, node in enumerate(nodes):
        for child in node.get("children", []):
            if child in parents:
                raise HeadError("the node tree of the file is not a tree; export it again")
            parents[child] = index
    for start in parents:
        at, steps = start, 0
        while at in parents:
            at, steps = parents[at], steps + 1
            if steps > MAX_DEPTH:
                raise HeadError(
                    f"the node tree of the file is not a tree, or deeper than {MAX_DEPTH}; export it again"
                )


def image_number(texture: dict[str, Any]) -> int:
    """The image of a texture. Raises HeadError: only one of a kind that is not read."""
    extensions = texture.get("extensions", {})
    if "EXT_texture_webp" in extensions:
        return int(extensions["EXT_texture_webp"]["source"])
    if "source" in texture:
        return int(texture["source"])
    names = ", ".join(map(str, extensions)) or "no image"
    raise HeadError(f"a texture is stored as {quoted(names)}; export it with PNG, JPEG or WebP images")


def uri_bytes(uri: str, folder: Path) -> bytes:
    if not uri.startswith("data:"):
        return read_mesh_bytes(find_inside(folder, unquote(uri), "buffer"), MAX_GEOMETRY_BYTES)
    try:
        return base64.b64decode(uri.partition("base64,")[2], validate=True)
    except binascii.Error as error:
        raise HeadError("an embedded file is not base64; export it again") from error


def gltf_files(path: Path) -> tuple[Path, ...]:
    """The buffers and images beside a .gltf.

    Raises
    ------
    HeadError: not glTF, or one of them is missing or outside of the folder.
    """
    header, _ = split_gltf(path)
    lists = [header.get(key) for key in ("buffers", "images")]
    entries = [e for found in lists if isinstance(found, list) for e in found if isinstance(e, dict)]
    uris = [entry["uri"] for entry in entries if isinstance(entry.get("uri"), str)]
    return tuple(find_inside(path.parent, unquote(u), "file") for u in uris if not u.startswith("data:"))

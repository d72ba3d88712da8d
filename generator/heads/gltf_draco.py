# SPDX-License-Identifier: GPL-3.0-or-later
"""Draco-compressed glTF: its geometry alone, unpacked by Blender's importer, which has the decoder.

Blender is given a file of our own making with no name of another file in it, so that it can open none;
images and materials are read here as those of any glTF.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from generator.errors import HeadError
from generator.heads.gltf_accessors import Accessors
from generator.heads.gltf_file import BIN, JSON, MAGIC, check_header, split_gltf
from generator.heads.limits import MAX_TRIANGLES, MAX_VERTICES, check_count

DRACO = "KHR_draco_mesh_compression"
_KEPT = ("scene", "accessors")
_NODE = ("mesh", "skin", "children", "weights", "matrix", "translation", "rotation", "scale")
_SKIN = ("joints", "skeleton", "inverseBindMatrices")
_PRIMITIVE = ("attributes", "indices", "mode", "targets", "material")
_SPARSE = ("indices", "values")
_BITSTREAM = (2, 2)
"""The only one that the extension allows."""

_MOST = 0.95
"""Of its triangles a material must come back with."""


def is_packed(header: dict[str, Any]) -> bool:
    """Is a primitive compressed? Raises as :func:`check_header` does."""
    return any(DRACO in p.get("extensions", {}) for m in header.get("meshes", []) for p in m["primitives"])


def unpack(
    header: dict[str, Any], accessors: Accessors, scratch: Path, convert: Callable[[Path, Path], Path] | None
) -> tuple[dict[str, Any], bytes]:
    """Header and binary chunk of the same geometry, not compressed; materials by their old numbers.

    Raises
    ------
    HeadError: no Blender, no Draco that Blender reads, or more than a head may have. As
        :func:`generator.heads.gltf_scene.read_pieces` for what is malformed.
    """
    if convert is None:
        raise HeadError(
            f"{DRACO} is unpacked by Blender, which is not available here; export it without compression"
        )
    packed = scratch / "packed.glb"
    shown = {node["mesh"] for node in header.get("nodes", []) if "mesh" in node}
    expected = _faces_of_materials(header, accessors, shown)
    packed.write_bytes(_geometry(header, accessors))
    folder = scratch / "unpacked"
    folder.mkdir(exist_ok=True)
    unpacked, binary = split_gltf(convert(packed, folder))
    check_header(unpacked)
    names = [material["name"] for material in unpacked.get("materials", [])]
    found: Counter[int | None] = Counter()
    for mesh in unpacked.get("meshes", []):
        for primitive in mesh["primitives"]:
            if "material" in primitive:
                primitive["material"] = int(names[primitive["material"]])
            if "indices" in primitive:
                count = unpacked["accessors"][primitive["indices"]]["count"] // 3
                found[primitive.get("material")] += count
    # Blender leaves out what it cannot unpack, and triangles that occur twice.
    if any(found[material] < _MOST * count for material, count in expected.items()):
        raise HeadError(f"{DRACO} is damaged; export the file again")
    return unpacked, binary


def _faces_of_materials(
    header: dict[str, Any], accessors: Accessors, shown: set[int]
) -> dict[int | None, int]:
    """How many compressed triangles of each material the meshes hold that are shown."""
    faces: Counter[int | None] = Counter()
    held = 0
    for index, mesh in enumerate(header["meshes"]):
        for primitive in mesh["primitives"]:
            if DRACO in primitive.get("extensions", {}):
                count = _faces(accessors.view_bytes(primitive["extensions"][DRACO]["bufferView"]))
                held += count
                check_count(held, MAX_TRIANGLES, "triangles")
                faces[primitive.get("material")] += count if index in shown else 0
    return faces


def _geometry(header: dict[str, Any], accessors: Accessors) -> bytes:
    """A GLB of what decides the shape, with the numbers of materials for names."""
    bare: dict[str, Any] = {key: header[key] for key in _KEPT if key in header}
    bare |= {"asset": {"version": "2.0"}, "skins": [_only(skin, _SKIN) for skin in header.get("skins", [])]}
    if "scenes" in header:
        bare["scenes"] = [_only(scene, ("nodes",)) for scene in header["scenes"]]
    bare["nodes"] = [_only(node, _NODE) for node in header.get("nodes", [])]
    bare["materials"] = [{"name": str(index)} for index in range(len(header.get("materials", [])))]
    bare["extensionsUsed"] = bare["extensionsRequired"] = [DRACO]
    views = {accessor["bufferView"] for accessor in header["accessors"] if "bufferView" in accessor}
    views |= {a["sparse"][k]["bufferView"] for a in header["accessors"] if "sparse" in a for k in _SPARSE}
    meshes = []
    for mesh in header["meshes"]:
        primitives = []
        for primitive in mesh["primitives"]:
            kept = _only(primitive, _PRIMITIVE)
            if DRACO in primitive.get("extensions", {}):
                packed = _only(primitive["extensions"][DRACO], ("bufferView", "attributes"))
                views.add(packed["bufferView"])
                kept["extensions"] = {DRACO: packed}
            primitives.append(kept)
        meshes.append({"primitives": primitives, **_only(mesh, ("weights",))})
    bare["meshes"] = meshes
    binary, places = bytearray(), []
    for index, view in enumerate(header["bufferViews"]):
        data = accessors.view_bytes(index) if index in views else b"\0"
        place = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)}
        places.append(place | _only(view, ("byteStride",)))
        binary += data + bytes(-len(data) % 4)
    bare |= {"bufferViews": places, "buffers": [{"byteLength": len(binary)}]}
    text = json.dumps(bare).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<2I", len(text), JSON) + text + struct.pack("<2I", len(binary), BIN) + binary
    return struct.pack("<3I", MAGIC, 2, 12 + len(chunks)) + chunks


def _only(values: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: values[key] for key in keys if key in values}


def _faces(data: bytes) -> int:
    """How many triangles a Draco stream says it holds, before anything makes room for them.

    Raises HeadError: a stream of another kind, or one with more vertices than a head may have.
    """
    if len(data) < 11 or data[:5] != b"DRACO":
        raise HeadError(f"what should be {DRACO} is not; export it again without compression")
    kind, method, flags = data[7], data[8], struct.unpack_from("<H", data, 9)[0]
    if tuple(data[5:7]) != _BITSTREAM or kind != 1 or method > 1 or flags:
        raise HeadError(f"a kind of {DRACO} that is not read; export it without compression")
    first, at = _varint(data, 12 if method == 1 else 11)
    second, _ = _varint(data, at)
    # Edgebreaker says vertices first, the sequential method faces.
    vertices, faces = (first, second) if method == 1 else (second, first)
    check_count(vertices, MAX_VERTICES, "vertices")
    return faces


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, and where it ends. IndexError: cut off."""
    value, shift = 0, 0
    while data[at] & 0x80 and shift < 63:
        value, shift, at = value | (data[at] & 0x7F) << shift, shift + 7, at + 1
    return value | data[at] << shift, at + 1

# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files that are read through Blender's importers."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.errors import HeadError
from generator.execution.lanes.renderer import Renderer
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))

from small_gltf import SmallGltf, image_uri

_COMPRESS = """
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
bpy.ops.export_scene.gltf(filepath=sys.argv[2], export_draco_mesh_compression_enable=True,
    export_rest_position_armature=False, export_vertex_color="ACTIVE", export_animations=False)
"""


def _posed(folder: Path) -> Path:
    """A skinned triangle with vertex colours at its pose, and a textured one with a morph target."""
    gltf = SmallGltf()
    textured = {"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    gltf.header |= {"materials": [{"name": "red"}, textured], "textures": [{"source": 0}]}
    gltf.header["images"] = [{"uri": image_uri((200, 100, 50))}]
    joint = gltf.node(translation=[0, 0, 5], rotation=[0.6, 0, 0, 0.8])
    attributes = gltf.bound([0, 0, 0, 0], [1, 0, 0, 0])
    attributes["COLOR_0"] = gltf.accessor(np.float32([[1, 0, 0, 1]] * 3))
    gltf.node(mesh=gltf.triangle(attributes, material=0), skin=0, scale=[9, 9, 9])
    gltf.header["skins"] = [{"joints": [joint]}]
    target = {"POSITION": gltf.accessor(np.float32([[0, 0, 2]] * 3))}
    gltf.node(mesh=gltf.triangle(material=1, targets=[target]), weights=[0.5], translation=[0, 3, 0])
    folder.mkdir()
    return gltf.write(folder / "head.gltf")


def _compressed(source: Path, target: Path) -> Path:
    target.parent.mkdir()
    command = [sys.executable, "-c", _COMPRESS, str(source), str(target)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return target


def _read(path: Path, scratch: Path, renderer: Renderer | None) -> HeadMesh:
    scratch.mkdir()
    (head,) = find_heads(path).heads
    return read_mesh(head, scratch, import_with_blender=renderer.import_mesh if renderer else None)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _posed(tmp_path_factory.mktemp("plain") / "head")


@pytest.fixture(scope="module")
def packed(plain: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _compressed(plain, tmp_path_factory.mktemp("packed") / "head" / "head.glb")


def test_draco_is_what_it_was_before_compression(
    renderer: Renderer, plain: Path, packed: Path, tmp_path: Path
) -> None:
    assert b"KHR_draco_mesh_compression" in packed.read_bytes()
    mesh = _read(packed, tmp_path / "a", renderer)
    original = _read(plain, tmp_path / "b", None)
    order, expected = (np.argsort(m.vertices[m.triangles].mean(1)[:, 1]) for m in (mesh, original))
    one, other = mesh.vertices[mesh.triangles[order]], original.vertices[original.triangles[expected]]
    np.testing.assert_allclose(np.sort(one, axis=1), np.sort(other, axis=1), atol=2e-3)
    assert mesh.uv is not None and original.uv is not None
    uv, expected_uv = mesh.uv[order], original.uv[expected]
    np.testing.assert_allclose(np.sort(uv, axis=1), np.sort(expected_uv, axis=1), atol=1e-3)
    assert sorted(material.name for material in mesh.materials) == ["red", "skin"]
    assert any(material.texture for material in mesh.materials)
    assert mesh.vertex_colors is not None
    assert [1, 0, 0] in mesh.vertex_colors.round(2).tolist()


def test_draco_without_blender_says_what_to_do(packed: Path, tmp_path: Path) -> None:
    with pytest.raises(HeadError, match=r"KHR_draco_mesh_compression.*export it without compression"):
        _read(packed, tmp_path / "a", None)


def _edited(packed: Path, target: Path, change: object) -> Path:
    data = packed.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    header = json.loads(data[20 : 20 + length])
    rest = bytearray(data[20 + length :])
    change(header, rest)  # type: ignore[operator]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    whole = struct.pack("<2I", len(text), 0x4E4F534A) + text + rest
    target.write_bytes(struct.pack("<3I", 0x46546C67, 2, 12 + len(whole)) + whole)
    return target


def _claims_many(header: dict, rest: bytearray) -> None:
    at = rest.index(b"DRACO")
    rest[at + 11 : at + 21] = b"\xff" * 9 + b"\x01"


def _other_kind(header: dict, rest: bytearray) -> None:
    rest[rest.index(b"DRACO") + 7] = 0


def _damaged(header: dict, rest: bytearray) -> None:
    at = rest.index(b"DRACO")
    rest[at + 20 : at + 60] = bytes(40)


def _not_there(header: dict, rest: bytearray) -> None:
    for mesh in header["meshes"]:
        mesh["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = 99


@pytest.mark.parametrize("change", [_claims_many, _other_kind, _damaged, _not_there])
def test_draco_that_is_none_is_refused_in_one_line(
    renderer: Renderer, packed: Path, tmp_path: Path, change: object
) -> None:
    path = _edited(packed, tmp_path / "head.glb", change)
    with pytest.raises(HeadError, match=r"head\.glb: [^\n]+$"):
        _read(path, tmp_path / "a", renderer)


def test_blender_is_shown_no_name_of_a_file(packed: Path, tmp_path: Path) -> None:
    def beside(header: dict, rest: bytearray) -> None:
        header["images"] = [{"uri": "skin.png"}]
        header["extras"] = header["nodes"][0]["extras"] = {"uri": "private"}
        header["buffers"].append({"uri": "private.bin", "byteLength": 4})

    seen = []

    def convert(source: Path, folder: Path) -> Path:
        seen.append(source.read_bytes())
        raise HeadError("seen")

    folder = tmp_path / "head"
    folder.mkdir()
    Image.new("RGB", (4, 4)).save(folder / "skin.png")
    path = _edited(packed, folder / "head.glb", beside)
    (head,) = find_heads(path).heads
    with pytest.raises(HeadError, match="seen"):
        read_mesh(head, tmp_path, import_with_blender=convert)
    assert b'"uri"' not in seen[0] and b"private" not in seen[0]

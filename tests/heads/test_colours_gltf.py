# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour drawn is the colour that a glTF names, or it is said."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

GLOSSY = "KHR_materials_pbrSpecularGlossiness"
TEXTURE = {"index": 0}


def data(content: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(content).decode()


def png(color: tuple[int, int, int]) -> str:
    stream = io.BytesIO()
    Image.new("RGB", (4, 4), color).save(stream, "PNG")
    return data(stream.getvalue())


def read(
    folder: Path,
    material: dict[str, Any],
    *,
    uv: float = 1.0,
    colors: list[Any] | None = None,
    sampler: dict[str, int] | None = None,
) -> HeadMesh:
    """A triangle. uv: how far its coordinates go. colors: of COLOR_0, RGB."""
    arrays = {
        "POSITION": np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0]]),
        "TEXCOORD_0": np.array([[0, 0], [1, 0], [1, 1]]) * uv,
        **({} if colors is None else {"COLOR_0": np.array(colors)}),
    }
    buffers = [array.astype("<f4").tobytes() for array in arrays.values()]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {n: i for i, n in enumerate(arrays)}, "material": 0}]},
        ],
        "materials": [{"name": "skin", **material}],
        "accessors": [
            {"bufferView": i, "componentType": 5126, "count": 3, "type": f"VEC{array.shape[1]}"}
            for i, array in enumerate(arrays.values())
        ],
        "bufferViews": [{"buffer": i, "byteLength": len(b)} for i, b in enumerate(buffers)],
        "buffers": [{"byteLength": len(b), "uri": data(b)} for b in buffers],
        "images": [{"uri": png((200, 150, 130))}, {"uri": png((1, 2, 3))}],
        "textures": [{"source": 0, **({} if sampler is None else {"sampler": 0})}, {"source": 1}],
        "samplers": [sampler or {}],
        "extensionsUsed": [GLOSSY],
        "extensionsRequired": [GLOSSY],
    }
    (folder / "head.gltf").write_text(json.dumps(document))
    (head,) = find_heads(folder / "head.gltf").heads
    return read_mesh(head, folder)


def pixel(mesh: HeadMesh) -> tuple[int, ...]:
    (material,) = mesh.materials
    assert material.texture is not None
    with Image.open(material.texture) as image:
        return image.convert("RGB").getpixel((0, 0))  # type: ignore[return-value]


def test_the_diffuse_texture_of_specular_glossiness(tmp_path: Path) -> None:
    mesh = read(
        tmp_path,
        {
            "extensions": {GLOSSY: {"diffuseTexture": TEXTURE, "diffuseFactor": [0.5, 1, 1, 1]}},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 1}},
        },
    )
    assert pixel(mesh) == (200, 150, 130)
    assert mesh.materials[0].tint == (0.5, 1, 1)
    assert not mesh.problems


def test_the_diffuse_factor_of_specular_glossiness(tmp_path: Path) -> None:
    mesh = read(tmp_path, {"extensions": {GLOSSY: {"diffuseFactor": [1, 0, 0, 1]}}})
    assert mesh.materials[0].base_color == (1, 0, 0)
    assert not mesh.problems


def test_a_base_colour_beside_a_texture_is_its_factor(tmp_path: Path) -> None:
    pbr = {"baseColorTexture": TEXTURE, "baseColorFactor": [0.1, 0.06, 0.04, 1]}
    mesh = read(tmp_path, {"pbrMetallicRoughness": pbr})
    assert mesh.materials[0].tint == (0.1, 0.06, 0.04)
    assert not mesh.materials[0].vertex_tint
    assert mesh.vertex_colors is None


@pytest.mark.parametrize(("low", "tinted"), [(0.2140411, True), (1.0, False)])
def test_vertex_colours_beside_a_texture_are_its_factors(tmp_path: Path, low: float, tinted: bool) -> None:
    pbr = {"baseColorTexture": TEXTURE, "baseColorFactor": [0.5, 0.5, 0.5, 1]}
    mesh = read(tmp_path, {"pbrMetallicRoughness": pbr}, colors=[[low, 1, 1]] * 3)
    assert mesh.materials[0].vertex_tint is tinted
    assert mesh.materials[0].tint == (0.5, 0.5, 0.5)
    if tinted:
        np.testing.assert_allclose(mesh.vertex_colors, [[0.5, 1, 1]] * 3, atol=1e-4)
    else:
        assert mesh.vertex_colors is None


@pytest.mark.parametrize(
    ("sampler", "wrap"),
    [
        (None, "repeat"),
        ({}, "repeat"),
        ({"wrapS": 10497, "wrapT": 10497}, "repeat"),
        ({"wrapS": 33071, "wrapT": 33071}, "extend"),
        ({"wrapS": 33648, "wrapT": 33648}, "mirror"),
    ],
)
def test_the_sampler_says_how_a_texture_goes_on(
    tmp_path: Path, sampler: dict[str, int] | None, wrap: str
) -> None:
    material = {"pbrMetallicRoughness": {"baseColorTexture": TEXTURE}}
    mesh = read(tmp_path, material, uv=3, sampler=sampler)
    assert mesh.materials[0].wrap == wrap
    assert not mesh.problems
    assert read(tmp_path, material, uv=1, sampler=sampler).materials[0].wrap == "extend"


def test_two_ways_to_go_on_are_noted(tmp_path: Path) -> None:
    material = {"pbrMetallicRoughness": {"baseColorTexture": TEXTURE}}
    mesh = read(tmp_path, material, uv=3, sampler={"wrapS": 33648})
    assert "goes on along u as mirror, along v as repeat; drawn as mirror" in mesh.problems[0]


def test_a_texture_of_emitted_light_alone_is_noted(tmp_path: Path) -> None:
    mesh = read(tmp_path, {"emissiveTexture": TEXTURE})
    assert "the emissive texture of 'skin' is not drawn" in mesh.problems

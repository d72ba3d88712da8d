# SPDX-License-Identifier: GPL-3.0-or-later
"""A glTF is read as a viewer shows it: skins at their pose, morph weights, every way to store numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_gltf import CORNERS, UV, SmallGltf, image_uri

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

QUARTER_ABOUT_X = [0.5**0.5, 0, 0, 0.5**0.5]


def read(gltf: SmallGltf, folder: Path) -> HeadMesh:
    (head,) = find_heads(gltf.write(folder / "head.gltf")).heads
    return read_mesh(head, folder)


def corners(mesh: HeadMesh) -> np.ndarray:
    return mesh.vertices[mesh.triangles]


def test_the_transform_of_a_skinned_mesh_s_node_is_ignored(tmp_path: Path) -> None:
    gltf = SmallGltf()
    mesh = gltf.triangle(gltf.bound([0, 0, 0, 0], [1, 0, 0, 0]))
    skinned = gltf.node(mesh=mesh, skin=0, rotation=QUARTER_ABOUT_X, scale=[100, 100, 100])
    gltf.node(children=[skinned], translation=[7, 0, 0])
    gltf.header["skins"] = [{"joints": [gltf.node()]}]
    np.testing.assert_allclose(corners(read(gltf, tmp_path))[0], CORNERS)


def test_skin_and_rigid_eye_under_a_posed_joint_stay_together(tmp_path: Path) -> None:
    gltf = SmallGltf()
    eye = gltf.node(mesh=gltf.triangle())
    joint = gltf.node(children=[eye], translation=[0, 0, 5], rotation=QUARTER_ABOUT_X, scale=[2, 2, 2])
    gltf.node(mesh=gltf.triangle(gltf.bound([0, 0, 0, 0], [1, 0, 0, 0])), skin=0)
    gltf.header["skins"] = [{"joints": [joint]}]
    one, other = corners(read(gltf, tmp_path))
    np.testing.assert_allclose(one, other, atol=1e-12)
    np.testing.assert_allclose(one, [[-2, 0, 3], [2, 0, 3], [2, 0, 7]], atol=1e-12)


@pytest.mark.parametrize("skinned", [True, False])
def test_what_is_mirrored_keeps_its_outside(tmp_path: Path, skinned: bool) -> None:
    """Rigs mirror one side of a body by a negative scale: a triangle that faces +Z goes on facing +Z."""
    gltf = SmallGltf()
    gltf.header |= {"textures": [{"source": 0}], "images": [{"uri": image_uri((200, 100, 50))}]}
    gltf.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    mirrored = gltf.node(scale=[-1, 1, 1])
    gltf.header["skins"] = [{"joints": [mirrored]}]
    if skinned:
        gltf.node(mesh=gltf.triangle(gltf.bound([0, 0, 0, 0], [1, 0, 0, 0]), material=0), skin=0)
    else:
        gltf.header["nodes"][mirrored]["mesh"] = gltf.triangle(material=0)
    mesh = read(gltf, tmp_path)
    (triangle,) = corners(mesh)
    assert np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])[2] > 0
    # Each corner keeps its texture coordinate: u went from left to right, and now goes back.
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[0][:, 0], (1 - triangle[:, 0]) / 2)


@pytest.mark.parametrize("total", [1.0, 0.5])
def test_joints_are_blended_from_their_bind_pose(tmp_path: Path, total: float) -> None:
    # Two joints that were bound at z = 1 and stand at z = 3 and z = 5: half of each is a move by 3.
    gltf = SmallGltf()
    joints = [gltf.node(translation=[0, 0, 3]), gltf.node(translation=[0, 0, 5])]
    unbind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    unbind[:, 3, 2] = -1  # columns follow each other
    inverse = gltf.accessor(unbind.reshape(2, 16))
    gltf.header["skins"] = [{"joints": joints, "inverseBindMatrices": inverse}]
    attributes = gltf.bound([0, 1, 0, 0], [total / 2, total / 2, 0, 0])
    gltf.node(mesh=gltf.triangle(attributes), skin=0)
    np.testing.assert_allclose(corners(read(gltf, tmp_path))[0], np.add(CORNERS, [0, 0, 3]))


@pytest.mark.parametrize(
    ("of_mesh", "of_node", "moved"), [([0.5, 0], None, 1), ([0.5, 0], [0, 1], 30), ([0, 0], None, 0)]
)
def test_default_morph_weights(tmp_path: Path, of_mesh: list, of_node: list | None, moved: float) -> None:
    gltf = SmallGltf()
    targets = [{"POSITION": gltf.accessor(np.float32([[0, 0, z]] * 3))} for z in (2, 30)]
    mesh = gltf.triangle(targets=targets)
    gltf.header["meshes"][mesh]["weights"] = of_mesh
    gltf.node(mesh=mesh, **({} if of_node is None else {"weights": of_node}))
    np.testing.assert_allclose(corners(read(gltf, tmp_path))[0], np.add(CORNERS, [0, 0, moved]))


def test_a_morph_target_may_be_sparse(tmp_path: Path) -> None:
    gltf = SmallGltf()
    sparse: dict[str, Any] = {"count": 1, "values": {"bufferView": gltf.view(np.float32([0, 0, 4]))}}
    sparse["indices"] = {"bufferView": gltf.view(np.uint8([2])), "componentType": 5121}
    gltf.header["accessors"].append({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse})
    gltf.node(mesh=gltf.triangle(targets=[{"POSITION": 0}]), weights=[1])
    np.testing.assert_allclose(
        corners(read(gltf, tmp_path))[0], np.add(CORNERS, [[0, 0, 0], [0, 0, 0], [0, 0, 4]])
    )


def test_quantized_coordinates(tmp_path: Path) -> None:
    gltf = SmallGltf()
    attributes = {
        "POSITION": gltf.accessor((CORNERS * 100).astype(np.int16)),
        "TEXCOORD_0": gltf.accessor((UV * 65535).astype(np.uint16), normalized=True),
    }
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    gltf.header |= {"materials": [material], "images": [{"uri": image_uri((9, 9, 9))}]}
    gltf.header |= {"textures": [{"source": 0}], "extensionsRequired": ["KHR_mesh_quantization"]}
    gltf.node(mesh=gltf.triangle(attributes, material=0), scale=[0.01] * 3)
    mesh = read(gltf, tmp_path)
    np.testing.assert_allclose(corners(mesh)[0], CORNERS, atol=1e-6)
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[0], [[0, 1], [1, 1], [1, 0]])


@pytest.mark.parametrize(
    ("mode", "expected"), [(5, [[0, 1, 2], [2, 1, 3]]), (6, [[0, 1, 2], [0, 2, 3]]), (1, None)]
)
def test_strips_and_fans_are_triangles_and_lines_are_none(
    tmp_path: Path, mode: int, expected: list | None
) -> None:
    gltf = SmallGltf()
    square = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    gltf.node(mesh=gltf.triangle({"POSITION": gltf.accessor(square)}, mode=mode))
    if expected is None:
        with pytest.raises(HeadError, match="no triangles"):
            read(gltf, tmp_path)
    else:
        assert read(gltf, tmp_path).triangles.tolist() == expected


def test_a_mirrored_node_keeps_its_outside(tmp_path: Path) -> None:
    gltf = SmallGltf()
    gltf.node(mesh=gltf.triangle(), scale=[-1, 1, 1])
    (a, b, c) = corners(read(gltf, tmp_path))[0]
    assert np.cross(b - a, c - a)[2] > 0


SHELLS = {
    "texture without alpha": ({"alphaMode": "BLEND"}, (9, 9, 9, 0), False),
    "film of shade": ({"alphaMode": "BLEND"}, (9, 9, 9, 90), False),
    "alpha of the colour": ({"alphaMode": "BLEND", "factor": 0.05}, (9, 9, 9), False),
    "both": ({"alphaMode": "BLEND", "factor": 0.7}, (9, 9, 9, 160), False),
    "cut off": ({"alphaMode": "MASK", "alphaCutoff": 0.9}, (9, 9, 9, 200), False),
    "transmission": ({"transmission": {"transmissionFactor": 1}}, (9, 9, 9), False),
    "transmission where its map says": (
        {"transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 1}}},
        (9, 9, 9),
        False,
    ),
    "opaque whatever the alpha": ({"factor": 0.05}, (9, 9, 9, 0), True),
    "blended and solid": ({"alphaMode": "BLEND"}, (9, 9, 9, 255), True),
    "masked and kept": ({"alphaMode": "MASK", "alphaCutoff": 0.2}, (9, 9, 9, 100), True),
    "no transmission where its map says": (
        {"transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 2}}},
        (9, 9, 9),
        True,
    ),
}


@pytest.mark.parametrize("name", SHELLS)
def test_a_shell_that_a_viewer_looks_through_is_left_out(tmp_path: Path, name: str) -> None:
    values, color, seen = SHELLS[name]
    shell: dict[str, Any] = {"name": "cornea", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    shell |= {key: value for key, value in values.items() if key.startswith("alpha")}
    shell["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, values.get("factor", 1)]
    shell["extensions"] = {"KHR_materials_transmission": values.get("transmission", {})}
    iris = {"name": "iris", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.1, 0.05, 1]}}
    gltf = SmallGltf()
    gltf.header |= {"materials": [iris, shell], "textures": [{"source": index} for index in range(3)]}
    gltf.header["images"] = [{"uri": image_uri(c)} for c in (color, (255, 0, 0), (0, 255, 255))]
    gltf.node(mesh=gltf.triangle(material=0), translation=[0, 0, -1])
    gltf.node(mesh=gltf.triangle(material=1))
    mesh = read(gltf, tmp_path)
    assert [material.name for material in mesh.materials] == ["iris", "cornea"][: 1 + seen]
    assert any("cornea" in problem for problem in mesh.problems) is not seen


def test_vertex_colours_may_be_clear(tmp_path: Path) -> None:
    gltf = SmallGltf()
    gltf.header["materials"] = [{"name": "skin"}, {"name": "tears", "alphaMode": "BLEND"}]
    gltf.node(mesh=gltf.triangle(material=0))
    clear = {"COLOR_0": gltf.accessor(np.uint8([[255, 255, 255, 20]] * 3), normalized=True)}
    gltf.node(mesh=gltf.triangle(clear, material=1), translation=[0, 0, 1])
    assert [material.name for material in read(gltf, tmp_path).materials] == ["skin"]


def test_a_webp_image_alone_is_the_texture(tmp_path: Path) -> None:
    gltf = SmallGltf()
    gltf.header |= {"images": [{"uri": image_uri((9, 9, 9), "WEBP")}], "materials": [_textured(0)]}
    gltf.header |= {"textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}]}
    gltf.header["extensionsRequired"] = ["EXT_texture_webp"]
    gltf.node(mesh=gltf.triangle(material=0))
    (material,) = read(gltf, tmp_path).materials
    assert material.texture is not None
    assert material.texture.suffix == ".webp"


def test_a_texture_of_a_kind_that_is_not_read_is_named(tmp_path: Path) -> None:
    gltf = SmallGltf()
    gltf.header |= {"images": [{"uri": "skin.ktx2"}], "materials": [_textured(0)]}
    gltf.header |= {"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]}
    gltf.node(mesh=gltf.triangle(material=0))
    (tmp_path / "skin.ktx2").write_bytes(b"KTX 20")
    with pytest.raises(HeadError, match=r"KHR_texture_basisu.*export it with PNG"):
        read(gltf, tmp_path)


def _textured(index: int) -> dict[str, Any]:
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}}


HOSTILE: dict[str, Any] = {
    "a node is its own child": lambda h: h["nodes"][0].update(children=[-1]),
    "a joint that is not there": lambda h: h["skins"][0].update(joints=[77]),
    "no weights": lambda h: h["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"),
    "too short": lambda h: h["accessors"][0].update(count=4000),
    "before the start": lambda h: h["accessors"][0].update(byteOffset=-8),
    "every vertex a thousand times": lambda h: h["meshes"][0].update(
        weights=[1] * 99,
        primitives=[{**h["meshes"][0]["primitives"][0], "targets": [{"POSITION": 0}] * 99}] * 99,
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_malformed_or_endless_is_refused(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("generator.heads.gltf_scene.MAX_MOVES", 1000)
    gltf = SmallGltf()
    gltf.node(mesh=gltf.triangle(gltf.bound([0, 0, 0, 0], [1, 0, 0, 0])), skin=0)
    gltf.header["skins"] = [{"joints": [gltf.node()]}]
    HOSTILE[name](gltf.header)
    with pytest.raises(HeadError, match=r"head\.gltf"):
        read(gltf, tmp_path)

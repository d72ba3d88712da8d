# SPDX-License-Identifier: GPL-3.0-or-later
"""Every format a head comes in, with its materials."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from small_meshes import FACES, TETRAHEDRON, TEXTURED_FACES, UV, plain_obj, textured_obj

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

EXAMPLES = Path(__file__).resolve().parents[3] / "shared" / "heads"
needs_examples = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the example heads are not here")


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    folder = tmp_path / "scratch"
    folder.mkdir()
    return folder


def read(path: Path, scratch: Path) -> HeadMesh:
    (head,) = find_heads(path).heads
    return read_mesh(head, scratch)


@needs_examples
def test_the_example_scan(scratch: Path) -> None:
    mesh = read(EXAMPLES / "lee_perry_smith_obj", scratch)
    assert (len(mesh.vertices), len(mesh.triangles)) == (8844, 17684)
    assert [(m.name, m.texture.name if m.texture else "", m.cutout) for m in mesh.materials] == [
        ("lambertian", "lambertian.jpg", False)
    ]


@needs_examples
def test_the_example_makehuman_head_has_solid_eyes(scratch: Path) -> None:
    # brown_eye.png has a transparent disc for the cornea of another eye model; these eyes do not use it.
    mesh = read(EXAMPLES / "makehuman_asian_young_f", scratch)
    assert [(m.name, m.cutout) for m in mesh.materials] == [("skin", False), ("eye", False)]
    assert np.bincount(mesh.material_index).tolist() == [9036, 172]
    assert not mesh.problems


def test_seams_are_welded_and_uv_stay_per_corner(tmp_path: Path, scratch: Path) -> None:
    # Two triangles that share an edge by position only, with different texture coordinates there.
    (tmp_path / "head.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 -0.0\n"
        "vt 0 0\nvt .2 0\nvt 0 .2\nvt .8 .8\nvt 1 1\nf 1/1 2/2 3/3\nf 4/4 5/5 6/4\nv 99 99 99\n"
    )
    Image.new("RGB", (4, 4)).save(tmp_path / "head.png")
    mesh = read(tmp_path / "head.obj", scratch)
    assert len(mesh.vertices) == 4
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[1], [[0.8, 0.8], [1, 1], [0.8, 0.8]])
    assert mesh.materials[0].texture == tmp_path / "head.png"


def test_polygons_relative_indices_and_windows_text(tmp_path: Path, scratch: Path) -> None:
    text = "# caf\xe9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv .5 2 0\nv 0 1 0\nf -5//1 -4//1 \\\n-3//1 -2//1 -1//1\n"
    (tmp_path / "head.obj").write_bytes(text.replace("\n", "\r\n").encode("latin-1"))
    mesh = read(tmp_path / "head.obj", scratch)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_materials_keep_their_order_of_appearance(tmp_path: Path, scratch: Path) -> None:
    (tmp_path / "head.obj").write_text(
        f"mtllib head.mtl\n{TETRAHEDRON}usemtl z\nf 1 3 2\nusemtl a\nf 1 2 4\nf 1 4 3\nusemtl z\nf 2 3 4\n"
    )
    (tmp_path / "head.mtl").write_text(
        "newmtl a\nKd 1 0 0\nnewmtl z\nKd 0 1 0\nnewmtl unused\nmap_Kd none.png\n"
    )
    mesh = read(tmp_path, scratch)
    assert [m.name for m in mesh.materials] == ["z", "a"]
    assert [m.base_color for m in mesh.materials] == [(0, 1, 0), (1, 0, 0)]
    assert mesh.material_index.tolist() == [0, 1, 1, 0]
    assert mesh.uv is None


@pytest.mark.parametrize("mtl", ["head.mtl", "head.obj.mtl", "HEAD.MTL"])
@pytest.mark.parametrize(
    "map_kd", ["skin.png", "-s 1 1 1 -o 0 0 0 skin.png", "SKIN.PNG", ".\\skin.png", "-clamp on skin.png"]
)
def test_the_texture_is_found_however_it_is_written(
    tmp_path: Path, scratch: Path, mtl: str, map_kd: str
) -> None:
    mesh = read(textured_obj(tmp_path / "a", map_kd, mtl=mtl), scratch)
    assert mesh.materials[0].texture == tmp_path / "a" / "skin.png"
    assert mesh.uv is not None
    assert mesh.uv.max() == pytest.approx(0.4)


@pytest.mark.parametrize(
    "map_kd",
    ["C:\\work\\scan 7\\skin.png", "/home/anna/skin.png", "D:/x/maps/Skin.PNG", "\\\\nas\\heads\\skin.png"],
)
def test_an_absolute_name_of_another_machine_is_looked_for_here(
    tmp_path: Path, scratch: Path, map_kd: str
) -> None:
    mesh = read(textured_obj(tmp_path / "a", map_kd), scratch)
    assert mesh.materials[0].texture == tmp_path / "a" / "skin.png"


def test_the_longest_end_of_an_absolute_name_is_the_file(tmp_path: Path, scratch: Path) -> None:
    path = textured_obj(tmp_path / "a", "C:\\scans\\anna\\skin.png")
    (tmp_path / "a" / "anna").mkdir()
    Image.new("RGB", (8, 8)).save(tmp_path / "a" / "anna" / "skin.png")
    assert read(path, scratch).materials[0].texture == tmp_path / "a" / "anna" / "skin.png"


@pytest.mark.parametrize(
    ("written", "encoding", "on_disk"),
    [
        ("Ge\u0301ne.png", "utf-8", "G\u00e9ne.png"),
        ("G\u00e9ne.png", "utf-8", "Ge\u0301ne.png"),
        ("G\u00e9ne.png", "latin-1", "G\u00e9ne.png"),
        ("Gr\u00f6\u00dfe.png", "latin-1", "Gr\u00f6\u00dfe.png"),
        ("\u76ae\u80a4.png", "gbk", "\u76ae\u80a4.png"),
        ("\u982d\\\u76ae\u80a4 1.png", "gbk", "\u982d/\u76ae\u80a4 1.png"),
    ],
)
def test_a_name_in_any_encoding_and_form_is_found(
    tmp_path: Path, scratch: Path, written: str, encoding: str, on_disk: str
) -> None:
    path = textured_obj(tmp_path / "a", image=False)
    (tmp_path / "a" / "head.mtl").write_bytes(f"newmtl skin\nmap_Kd {written}\n".encode(encoding))
    (tmp_path / "a" / on_disk).parent.mkdir(exist_ok=True)
    Image.new("RGB", (8, 8)).save(tmp_path / "a" / on_disk)
    assert read(path, scratch).materials[0].texture == tmp_path / "a" / on_disk


def test_file_names_with_blanks_and_texture_scale(tmp_path: Path, scratch: Path) -> None:
    path = textured_obj(tmp_path / "a", "-s 2 0.5 1 maps\\my skin.png")
    (tmp_path / "a" / "maps").mkdir()
    (tmp_path / "a" / "skin.png").rename(tmp_path / "a" / "maps" / "my skin.png")
    mesh = read(path, scratch)
    assert mesh.materials[0].texture == tmp_path / "a" / "maps" / "my skin.png"
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv.max((0, 1)), [0.8, 0.2], atol=1e-6)


def test_no_material_is_plain_skin_and_said(tmp_path: Path, scratch: Path) -> None:
    mesh = read(plain_obj(tmp_path / "head.obj"), scratch)
    assert mesh.materials[0].texture is None
    assert mesh.materials[0].base_color[0] > mesh.materials[0].base_color[2]
    assert "plain skin" in mesh.problems[0]


def test_a_missing_texture_is_an_error_that_says_what_to_do(tmp_path: Path, scratch: Path) -> None:
    (head,) = find_heads(textured_obj(tmp_path / "a", image=False)).heads
    assert "'skin.png' is missing" in head.problems[0]
    with pytest.raises(HeadError, match=r"head\.obj.*'skin\.png' is missing; put it"):
        read_mesh(head, scratch)


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 1.0), (255.0, 1.0)])
def test_vertex_colours_in_obj(tmp_path: Path, scratch: Path, scale: float, expected: float) -> None:
    lines = [f"{line} {scale} 0 {scale / 2}" for line in TETRAHEDRON.splitlines()]
    (tmp_path / "head.obj").write_text("\n".join(lines) + "\n" + FACES)
    mesh = read(tmp_path / "head.obj", scratch)
    assert mesh.vertex_colors is not None
    np.testing.assert_allclose(mesh.vertex_colors[0], [expected, 0, 0.5], atol=0.01)
    assert not mesh.problems


def _atlas(path: Path, hole: tuple[int, int, int, int]) -> None:
    image = Image.new("RGBA", (64, 64), (200, 150, 130, 255))
    image.paste((0, 0, 0, 0), hole)
    image.save(path)


@pytest.mark.parametrize(
    ("hole", "cutout"), [((0, 0, 32, 32), False), ((8, 40, 20, 60), True), ((0, 0, 64, 64), False)]
)
def test_alpha_is_a_cutout_only_where_the_mesh_uses_holes(
    tmp_path: Path, scratch: Path, hole: tuple[int, int, int, int], cutout: bool
) -> None:
    # The triangles use u, v in 0.1-0.4: the lower left of the image.
    # An alpha of 0 everywhere is an exporter's slip.
    path = textured_obj(tmp_path / "a")
    _atlas(tmp_path / "a" / "skin.png", hole)
    assert read(path, scratch).materials[0].cutout is cutout


def test_an_opacity_map_becomes_the_alpha_of_a_texture(tmp_path: Path, scratch: Path) -> None:
    path = textured_obj(tmp_path / "a")
    (tmp_path / "a" / "head.mtl").write_text("newmtl skin\nmap_Kd skin.png\nmap_d opacity.png\n")
    opacity = Image.new("L", (16, 16), 255)
    opacity.paste(0, (2, 10, 5, 15))
    opacity.save(tmp_path / "a" / "opacity.png")
    (material,) = read(path, scratch).materials
    assert material.cutout
    assert material.texture is not None
    assert material.texture.parent == scratch
    with Image.open(material.texture) as image:
        assert image.mode == "RGBA"


def test_see_through_shells_are_left_out(tmp_path: Path, scratch: Path) -> None:
    (tmp_path / "head.obj").write_text(
        f"mtllib head.mtl\n{TETRAHEDRON}usemtl skin\nf 1 3 2\nf 1 2 4\nusemtl cornea\nf 1 4 3\n"
    )
    (tmp_path / "head.mtl").write_text("newmtl skin\nKd 1 1 1\nnewmtl cornea\nKd 1 1 1\nd 0.1\n")
    mesh = read(tmp_path, scratch)
    assert len(mesh.triangles) == 2
    assert "cornea" in mesh.problems[0]


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_ply_with_vertex_colours(tmp_path: Path, scratch: Path, encoding: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.visual.vertex_colors = np.tile([255, 128, 0, 255], (len(ball.vertices), 1))
    (tmp_path / "head.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, encoding=encoding))
    mesh = read(tmp_path, scratch)
    assert (len(mesh.vertices), len(mesh.triangles)) == (42, 80)
    assert mesh.vertex_colors is not None
    np.testing.assert_allclose(mesh.vertex_colors[0], [1, 128 / 255, 0])


def test_ply_of_mixed_polygons_with_a_texture(tmp_path: Path, scratch: Path) -> None:
    header = "ply\nformat ascii 1.0\ncomment TextureFile my skin.png\nelement vertex 5\n"
    header += "".join(f"property float {name}\n" for name in "xyzst")
    header += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    body = "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n0 2 0 .5 .5\n4 0 1 2 3\n3 3 2 4\n"
    (tmp_path / "head.ply").write_text(header + body)
    Image.new("RGB", (4, 4)).save(tmp_path / "my skin.png")
    mesh = read(tmp_path, scratch)
    assert (len(mesh.vertices), len(mesh.triangles)) == (5, 3)
    assert mesh.materials[0].texture == tmp_path / "my skin.png"
    assert mesh.uv is not None
    corner = mesh.vertices[mesh.triangles]
    np.testing.assert_allclose(mesh.uv[..., 0][corner[..., 1] < 2], corner[..., 0][corner[..., 1] < 2])


def _glb_scene() -> trimesh.Scene:
    image = Image.new("RGB", (16, 16), (10, 200, 30))
    material = trimesh.visual.material.PBRMaterial(name="skin", baseColorTexture=image)
    ball = trimesh.creation.icosphere(subdivisions=1)
    uv = ball.vertices[:, :2] / 4 + 0.5
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    box = trimesh.creation.box()
    red = trimesh.visual.material.PBRMaterial(name="red", baseColorFactor=[255, 0, 0, 255])
    box.visual = trimesh.visual.TextureVisuals(material=red)
    scene = trimesh.Scene()
    scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([10, 0, 0]))
    scene.add_geometry(box)
    return scene


def test_glb_with_embedded_texture_and_transforms(tmp_path: Path, scratch: Path) -> None:
    (tmp_path / "head.glb").write_bytes(_glb_scene().export(file_type="glb"))
    mesh = read(tmp_path, scratch)
    by_name = dict(zip((m.name for m in mesh.materials), range(2), strict=True))
    skin, red = mesh.materials[by_name["skin"]], mesh.materials[by_name["red"]]
    assert red.base_color == (1, 0, 0)
    assert skin.texture is not None
    assert skin.texture.parent == scratch
    with Image.open(skin.texture) as image:
        assert image.size == (16, 16)
    of_skin = mesh.material_index == by_name["skin"]
    corner = mesh.vertices[mesh.triangles[of_skin]]
    assert corner[..., 0].min() == pytest.approx(9, abs=0.1)
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[of_skin], (corner - [10, 0, 0])[..., :2] / 4 + 0.5, atol=1e-6)


def test_gltf_with_files_beside_it(tmp_path: Path, scratch: Path) -> None:
    for name, data in _glb_scene().export(file_type="gltf").items():
        (tmp_path / name.replace("model.gltf", "head.gltf")).write_bytes(data)
    (head,) = find_heads(tmp_path).heads
    assert len(head.files) > 2
    mesh = read_mesh(head, scratch)
    assert sorted(m.name for m in mesh.materials) == ["red", "skin"]


def test_glb_vertex_colours_are_linear(tmp_path: Path, scratch: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.visual.vertex_colors = np.tile([255, 55, 0, 255], (len(ball.vertices), 1))
    (tmp_path / "head.glb").write_bytes(trimesh.Scene(ball).export(file_type="glb"))
    mesh = read(tmp_path, scratch)
    assert mesh.vertex_colors is not None
    np.testing.assert_allclose(mesh.vertex_colors[0], [1, 0.5, 0], atol=0.01)


def test_fbx_goes_through_the_converter_it_is_given(tmp_path: Path, scratch: Path) -> None:
    # The header of version 7.4 and the empty record at the end.
    (tmp_path / "head.fbx").write_bytes(b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400) + bytes(13))
    (head,) = find_heads(tmp_path).heads
    with pytest.raises(HeadError, match="Blender"):
        read_mesh(head, scratch)

    def convert(fbx: Path, folder: Path) -> Path:
        target = folder / f"{fbx.stem}.glb"
        target.write_bytes(_glb_scene().export(file_type="glb"))
        return target

    assert len(read_mesh(head, scratch, import_with_blender=convert).materials) == 2


@pytest.mark.slow
def test_a_large_mesh_is_read_whole(tmp_path: Path, scratch: Path) -> None:
    # FaceScape's size: 26 k vertices, 52 k triangles.
    ball = trimesh.creation.uv_sphere(count=[162, 162])
    text = io.StringIO()
    np.savetxt(text, ball.vertices, fmt="v %.6f %.6f %.6f")
    np.savetxt(text, ball.faces + 1, fmt="f %d %d %d")
    (tmp_path / "head.obj").write_text(text.getvalue())
    assert len(read(tmp_path, scratch).triangles) == len(ball.faces)


def test_reading_twice_gives_the_same_arrays(tmp_path: Path, scratch: Path) -> None:
    path = textured_obj(tmp_path / "a")
    one, two = read(path, scratch), read(path, scratch)
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert one.triangles.tobytes() == two.triangles.tobytes()
    assert json.dumps([m.name for m in one.materials]) == json.dumps([m.name for m in two.materials])
    assert UV in path.read_text() and TEXTURED_FACES in path.read_text()

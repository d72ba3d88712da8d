# SPDX-License-Identifier: GPL-3.0-or-later
"""Collada is read as it says: unit, axes, nodes, every kind of faces, colours, skins and morphs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_collada import (
    CORNERS,
    PLAIN,
    SHOWN,
    TEXCOORD,
    TEXTURED,
    VERTEX,
    bound,
    collada,
    geometry,
    source,
    write,
)

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

FLAT = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0]])


def read(folder: Path, document: str, **options: bool) -> HeadMesh:
    (head,) = find_heads(write(folder, document, **options)).heads
    return read_mesh(head, folder)


def corners(mesh: HeadMesh) -> np.ndarray:
    return mesh.vertices[mesh.triangles]


@pytest.mark.parametrize(
    ("asset", "expected"),
    [
        ("", FLAT),
        ("<up_axis>Y_UP</up_axis>", FLAT),
        ("<up_axis>Z_UP</up_axis>", [[-1, 0, 1], [1, 0, 1], [1, 0, -1]]),
        ("<up_axis>X_UP</up_axis>", [[1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
        ('<unit name="inch" meter="0.0254"/>', FLAT * 0.0254),
        ('<unit meter="0.01"/><up_axis>Z_UP</up_axis>', np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1]]) / 100),
    ],
)
def test_unit_and_up_axis(tmp_path: Path, asset: str, expected: np.ndarray) -> None:
    np.testing.assert_allclose(corners(read(tmp_path, collada(asset=asset)))[0], expected, atol=1e-12)


def test_transforms_of_nodes_follow_each_other(tmp_path: Path) -> None:
    nodes = (
        "<node><translate>0 0 5</translate><rotate>1 0 0 90</rotate>"
        "<node><matrix>2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1</matrix>"
        f"<scale>1 1 1</scale>{SHOWN}</node></node>"
    )
    mesh = read(tmp_path, collada(nodes=nodes))
    np.testing.assert_allclose(corners(mesh)[0], [[-2, 0, 3], [2, 0, 3], [2, 0, 7]], atol=1e-12)


def test_what_is_mirrored_keeps_its_outside(tmp_path: Path) -> None:
    (triangle,) = corners(read(tmp_path, collada(nodes=f"<node><scale>-1 1 1</scale>{SHOWN}</node>")))
    assert np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])[2] > 0


def test_nodes_of_a_library_are_shown_where_they_are_named(tmp_path: Path) -> None:
    library = f'<library_nodes><node id="n">{SHOWN}</node></library_nodes>'
    place = '<node><translate>{} 0 0</translate><instance_node url="#n"/></node>'
    mesh = read(tmp_path, collada(more=library, nodes=place.format(10) + place.format(20)))
    assert corners(mesh)[:, 0, 0].tolist() == [9, 19]


SQUARE = "0 0 0 1 0 0 1 1 0 0 1 0 2 2 0"

FACES = {
    "triangles": "<triangles>{}<p>0 1 2 0 2 3</p></triangles>",
    "polylist": "<polylist>{}<vcount>4</vcount><p>0 1 2 3</p></polylist>",
    "a line and a point in a polylist": "<polylist>{}<vcount>2 4 1</vcount><p>4 0 0 1 2 3 4</p></polylist>",
    "polygons": "<polygons>{}<p>0 1 2 3</p></polygons>",
    "polygons one by one": "<polygons>{}<p>0 1 2</p><p>0 2 3</p></polygons>",
    "a polygon with a hole": "<polygons>{}<ph><p>0 1 2 3</p><h>0 1 2</h></ph></polygons>",
    "tristrips": "<tristrips>{}<p>0 1 3 2</p></tristrips>",
    "trifans": "<trifans>{}<p>0 1 2</p><p>0 2 3</p></trifans>",
    "lines beside it": "<lines>{}<p>0 1</p></lines><triangles>{}<p>0 1 2 0 2 3</p></triangles>",
}


@pytest.mark.parametrize("kind", FACES)
def test_every_kind_of_faces(tmp_path: Path, kind: str) -> None:
    written = geometry(FACES[kind].replace("{}", VERTEX), corners=SQUARE)
    triangles = corners(read(tmp_path, collada(geometries=written)))
    assert len(triangles) == 2
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    np.testing.assert_allclose(normals, [[0, 0, 1]] * 2)
    assert triangles.max() == 1


@pytest.mark.parametrize(
    ("tool", "expected"), [("Blender 4.5", (0.4845, 0.6652, 0.7977)), ("Maya", (0.2, 0.4, 0.6)), ("", None)]
)
def test_plain_colours_are_as_shown_but_for_blender_s_which_are_linear(
    tmp_path: Path, tool: str, expected: tuple[float, ...] | None
) -> None:
    asset = f"<contributor><authoring_tool>{tool}</authoring_tool></contributor>"
    (material,) = read(tmp_path, collada(asset=asset)).materials
    assert material.name == "skin"
    assert material.base_color == pytest.approx(expected or (0.2, 0.4, 0.6), abs=1e-3)


@pytest.mark.parametrize(
    "image",
    [
        "skin.png",
        "./skin.png",
        "file://skin.png",
        "file:///C:/art/skin.png",
        "C:\\art\\skin.png",
        "s%6bin.png",
    ],
)
def test_a_texture_is_found_by_its_name(tmp_path: Path, image: str) -> None:
    path = write(tmp_path, collada(shader=TEXTURED, image=image))
    (head,) = find_heads(path).heads
    assert [file.name for file in head.files] == ["head.dae", "skin.png"]
    mesh = read_mesh(head, tmp_path)
    assert mesh.materials[0].texture == tmp_path / "skin.png"
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[0], [[0, 0], [1, 0], [1, 1]])
    assert mesh.problems == ()


def test_version_1_5_names_its_image_in_another_way(tmp_path: Path) -> None:
    document = collada(shader=TEXTURED).replace("<source>f</source>", '<instance_image url="#i"/>')
    document = document.replace(
        "<init_from>skin.png</init_from>", "<init_from><ref>skin.png</ref></init_from>"
    )
    assert read(tmp_path, document).materials[0].texture == tmp_path / "skin.png"


def test_a_missing_texture_refuses_and_is_listed(tmp_path: Path) -> None:
    path = write(tmp_path, collada(shader=TEXTURED), image=False)
    (head,) = find_heads(path).heads
    assert "'skin.png' is missing" in head.problems[0]
    with pytest.raises(HeadError, match=r"head\.dae: the texture 'skin\.png' is missing"):
        read_mesh(head, tmp_path)


def test_a_missing_image_that_is_not_drawn_does_not(tmp_path: Path) -> None:
    shader = PLAIN.replace("<diffuse>", '<specular><texture texture="s" texcoord="UV"/></specular><diffuse>')
    (head,) = find_heads(write(tmp_path, collada(shader=shader), image=False)).heads
    assert not any("missing" in problem for problem in head.problems)
    assert read_mesh(head, tmp_path).problems == ()


@pytest.mark.parametrize(
    ("sampler", "wrap"), [("", "repeat"), ("<wrap_s>MIRROR</wrap_s><wrap_t>MIRROR</wrap_t>", "mirror")]
)
def test_textures_go_on_as_the_sampler_says(tmp_path: Path, sampler: str, wrap: str) -> None:
    written = geometry().replace("0 0 1 0 1 1", "0 0 3 0 3 3")
    mesh = read(tmp_path, collada(shader=TEXTURED, sampler=sampler, geometries=written))
    assert mesh.materials[0].wrap == wrap


def test_the_coordinates_are_those_that_the_texture_names(tmp_path: Path) -> None:
    other = TEXCOORD.replace("#uv", "#uv2").replace('set="0"', 'set="1"')
    faces = f'<triangles material="m">{VERTEX}{TEXCOORD}{other}<p>0 0 1 1 2 2</p></triangles>'
    uses = '<bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="1"/>'
    document = collada(
        shader=TEXTURED,
        geometries=geometry(faces, source("uv2", "0.5 0.5 0.6 0.5 0.6 0.6", 2)),
        nodes=f'<node><instance_geometry url="#g">{bound(more=uses)}</instance_geometry></node>',
    )
    mesh = read(tmp_path, document)
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[0], [[0.5, 0.5], [0.6, 0.5], [0.6, 0.6]])


def test_vertex_colours(tmp_path: Path) -> None:
    faces = (
        f'<triangles>{VERTEX}<input semantic="COLOR" source="#c" offset="1"/><p>0 0 1 1 2 2</p></triangles>'
    )
    mesh = read(tmp_path, collada(geometries=geometry(faces, source("c", "1 0 0 0 1 0 0.2 0.4 0.6", 3))))
    assert mesh.vertex_colors is not None
    np.testing.assert_allclose(mesh.vertex_colors, [[1, 0, 0], [0, 1, 0], [0.2, 0.4, 0.6]], atol=1e-6)


def _transparent(opaque: str, color: str, share: float) -> str:
    return (
        "<phong><diffuse><color>1 1 1 1</color></diffuse>"
        f'<transparent opaque="{opaque}"><color>{color}</color>'
        f"</transparent><transparency><float>{share}</float></transparency></phong>"
    )


@pytest.mark.parametrize(
    ("shader", "drawn"),
    [
        (_transparent("A_ONE", "1 1 1 1", 1), True),
        (_transparent("A_ONE", "1 1 1 0.1", 1), False),
        (_transparent("A_ONE", "1 1 1 1", 0.1), False),
        (_transparent("RGB_ZERO", "0 0 0 1", 1), True),
        (_transparent("RGB_ZERO", "1 1 1 1", 0.9), False),
        ("<phong><transparency><float>0.2</float></transparency></phong>", False),
    ],
)
def test_shells_that_one_looks_through_are_left_out(tmp_path: Path, shader: str, drawn: bool) -> None:
    skin = (
        f'<library_effects><effect id="e2"><profile_COMMON><technique>{PLAIN}</technique></profile_COMMON>'
        '</effect></library_effects><library_materials><material id="k"><instance_effect url="#e2"/>'
        "</material></library_materials>"
    )
    eye = f'<instance_geometry url="#g">{bound(target="#k")}</instance_geometry>'
    nodes = f"<node>{SHOWN}</node><node><translate>9 0 0</translate>{eye}</node>"
    mesh = read(tmp_path, collada(shader=shader, more=skin, nodes=nodes))
    assert len(mesh.triangles) == 1 + drawn
    assert ("the see-through material 'skin' is left out" in mesh.problems) is not drawn


def test_a_head_of_nothing_but_shells_is_written_the_other_way_round(tmp_path: Path) -> None:
    assert len(read(tmp_path, collada(shader=_transparent("A_ONE", "1 1 1 1", 0))).triangles) == 1


@pytest.mark.parametrize("own_image", [True, False])
def test_cards_have_holes(tmp_path: Path, own_image: bool) -> None:
    mask = Image.new("L", (8, 8), 255)
    mask.paste(0, (4, 0, 8, 8))
    image = Image.new("RGB", (8, 8), (90, 60, 30))
    image.putalpha(mask)
    image.save(tmp_path / "hair.png")
    transparent = '<transparent opaque="A_ONE"><texture texture="s" texcoord="UV"/></transparent>'
    shader = (TEXTURED if own_image else PLAIN.replace("phong", "lambert")).replace(
        "</lambert>", f"{transparent}</lambert>"
    )
    (material,) = read(tmp_path, collada(shader=shader, image="hair.png")).materials
    assert material.cutout and material.texture is not None


JOINTS = '<source id="{}"><{kind} count="{count}">{names}</{kind}></source>'


def _skin(names: str, weights: str, v: str, vcount: str = "1 1 1", bind: str = "") -> str:
    count = len(names.split())
    matrices = " ".join(["1 0 0 0 0 1 0 0 0 0 1 -1 0 0 0 1"] * count)
    return (
        f'<library_controllers><controller id="c"><skin source="#g">{bind}'
        f"{JOINTS.format('j', kind='Name_array', count=count, names=names)}"
        f"{source('b', matrices, 16)}{source('wt', weights, 1)}"
        '<joints><input semantic="JOINT" source="#j"/>'
        '<input semantic="INV_BIND_MATRIX" source="#b"/></joints>'
        f'<vertex_weights count="3"><input semantic="JOINT" source="#j" offset="0"/>'
        f'<input semantic="WEIGHT" source="#wt" offset="1"/>'
        f"<vcount>{vcount}</vcount><v>{v}</v></vertex_weights>"
        "</skin></controller></library_controllers>"
    )


SKELETON = (
    '<node id="root"><node id="n1" sid="J1" type="JOINT"><translate>0 0 3</translate></node>'
    '<node id="n2" sid="J2" type="JOINT"><translate>0 0 5</translate></node></node>'
    '<node><scale>9 9 9</scale><instance_controller url="#c"><skeleton>#root</skeleton>'
    "</instance_controller></node>"
)


@pytest.mark.parametrize(
    ("weights", "v", "vcount", "moved"),
    [
        ("1", "0 0 0 0 0 0", "1 1 1", [2, 2, 2]),
        ("0.5", "0 0 1 0 0 0 1 0 0 0 1 0", "2 2 2", [3, 3, 3]),
        ("0.1", "0 0 1 0 0 0 1 0 0 0 1 0", "2 2 2", [3, 3, 3]),  # weights that add up to less than 1
        ("1", "0 0 1 0", "1 1 0", [2, 4, 0]),
        ("1", "-1 0 -1 0 -1 0", "1 1 1", [0, 0, 0]),  # bound to where it was
    ],
)
def test_skins_are_where_their_joints_are(
    tmp_path: Path, weights: str, v: str, vcount: str, moved: list
) -> None:
    mesh = read(tmp_path, collada(more=_skin("J1 J2", weights, v, vcount), nodes=SKELETON))
    np.testing.assert_allclose(corners(mesh)[0], FLAT + np.outer(moved, [0, 0, 1]), atol=1e-12)


def test_a_skin_has_the_shape_it_was_bound_in(tmp_path: Path) -> None:
    bind = "<bind_shape_matrix>-2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1</bind_shape_matrix>"
    mesh = read(tmp_path, collada(more=_skin("J1 J2", "1", "0 0 0 0 0 0", bind=bind), nodes=SKELETON))
    (triangle,) = corners(mesh)
    assert sorted(triangle.tolist()) == [[-2, -2, 2], [-2, 2, 2], [2, -2, 2]]
    assert np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])[2] > 0, "and its outside"


@pytest.mark.parametrize(("method", "moved"), [("RELATIVE", [0, 0, 2]), ("NORMALIZED", None)])
def test_morphs_at_their_default_weights(tmp_path: Path, method: str, moved: list | None) -> None:
    target = geometry(corners="0 0 4 0 0 4 0 0 4").replace('id="g"', 'id="t"').replace('"p"', '"tp"')
    target = target.replace('"v"', '"tv"').replace('"#p"', '"#tp"').replace('id="uv', 'id="tuv')
    morph = (
        f'<library_controllers><controller id="c"><morph source="#g" method="{method}">'
        f"{JOINTS.format('j', kind='IDREF_array', count=1, names='t')}{source('wt', '0.5', 1)}"
        '<targets><input semantic="MORPH_TARGET" source="#j"/>'
        '<input semantic="MORPH_WEIGHT" source="#wt"/></targets>'
        "</morph></controller></library_controllers>"
    )
    nodes = '<node><instance_controller url="#c"/></node>'
    mesh = read(tmp_path, collada(geometries=geometry() + target, more=morph, nodes=nodes))
    expected = FLAT / 2 + [0, 0, 2] if moved is None else FLAT + moved
    np.testing.assert_allclose(corners(mesh)[0], expected, atol=1e-12)


@pytest.mark.parametrize("drawn", [True, False])
def test_a_texture_that_shines_is_drawn_where_nothing_else_is_or_noted(tmp_path: Path, drawn: bool) -> None:
    """Of scans whose light is in the texture."""
    emission = '<emission><texture texture="s" texcoord="UV"/></emission>'
    shader = f"<constant>{emission}</constant>" if drawn else PLAIN.replace("<phong>", f"<phong>{emission}")
    mesh = read(tmp_path, collada(shader=shader))
    assert (mesh.materials[0].texture is not None) is drawn
    assert ("the emissive texture of 'skin' is not drawn" in mesh.problems) is not drawn


def test_a_file_without_a_scene_shows_its_shapes(tmp_path: Path) -> None:
    document = collada().partition("<library_visual_scenes>")[0] + "</COLLADA>"
    mesh = read(tmp_path, document)
    np.testing.assert_allclose(corners(mesh)[0], np.array(CORNERS.split(), float).reshape(3, 3))
    assert mesh.materials[0].base_color == pytest.approx((0.2, 0.4, 0.6), abs=1e-6)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour drawn is the colour that the OBJ names, or it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_meshes import FACES, TETRAHEDRON, TEXTURED_FACES, UV, textured_obj

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

TWO_MATERIALS = f"{TETRAHEDRON}{UV}usemtl a\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nusemtl b\nf 1/1 4/2 3/3\n"


def read(path: Path) -> tuple[HeadMesh, tuple[str, ...]]:
    """The mesh, and every note about its head."""
    (head,) = find_heads(path).heads
    mesh = read_mesh(head, path.parent)
    return mesh, (*head.problems, *mesh.problems)


def libraries(folder: Path, *names: str) -> None:
    """name.mtl with the material name and the texture name.png, for each name."""
    for name in names:
        (folder / f"{name}.mtl").write_text(f"newmtl {name[-1]}\nmap_Kd {name}.png\n")
        Image.new("RGB", (4, 4)).save(folder / f"{name}.png")


@pytest.mark.parametrize(
    "lines",
    [
        "mtllib a.mtl b.mtl\n" + TWO_MATERIALS,
        "mtllib a.mtl\nmtllib b.mtl\n" + TWO_MATERIALS,
        "  mtllib\tb.mtl \\\n a.mtl\n" + TWO_MATERIALS,
        TWO_MATERIALS + "#" * 70_000 + "\nmtllib a.mtl b.mtl\n",
        "mtllib a.mtl\r" + TWO_MATERIALS.replace("\n", "\r") + "mtllib b.mtl\r",
    ],
)
def test_every_material_file_is_read(tmp_path: Path, lines: str) -> None:
    (tmp_path / "head.obj").write_text(lines, newline="")
    libraries(tmp_path, "a", "b")
    mesh, notes = read(tmp_path / "head.obj")
    assert [m.texture and m.texture.name for m in mesh.materials] == ["a.png", "b.png"]
    assert notes == ("licence unknown",)
    (head,) = find_heads(tmp_path / "head.obj").heads
    assert {file.name for file in head.files} == {"head.obj", "a.mtl", "b.mtl", "a.png", "b.png"}


def test_names_of_material_files_may_hold_blanks(tmp_path: Path) -> None:
    (tmp_path / "head.obj").write_text("mtllib my  a.mtl\nmtllib my b.mtl c.mtl\n" + TWO_MATERIALS)
    libraries(tmp_path, "my  a", "my b", "c")
    mesh, _ = read(tmp_path / "head.obj")
    assert [m.texture and m.texture.name for m in mesh.materials] == ["my  a.png", "my b.png"]


def test_of_two_materials_of_one_name_the_first_is_meant(tmp_path: Path) -> None:
    (tmp_path / "head.obj").write_text("mtllib a.mtl ba.mtl b.mtl\n" + TWO_MATERIALS)
    libraries(tmp_path, "a", "ba", "b")
    mesh, _ = read(tmp_path / "head.obj")
    assert [m.texture and m.texture.name for m in mesh.materials] == ["a.png", "b.png"]


@pytest.mark.parametrize("named", ["gone.mtl", "a.mtl gone.mtl"])
def test_a_missing_material_file_that_is_needed_refuses(tmp_path: Path, named: str) -> None:
    (tmp_path / "head.obj").write_text(f"mtllib {named}\n{TWO_MATERIALS}")
    libraries(tmp_path, "a")
    with pytest.raises(HeadError, match=r"material file 'gone\.mtl' is missing; put it"):
        read(tmp_path / "head.obj")
    (head,) = find_heads(tmp_path / "head.obj").heads
    assert "'gone.mtl' is missing" in head.problems[0]


def test_a_missing_material_file_that_is_not_needed_is_noted(tmp_path: Path) -> None:
    (tmp_path / "head.obj").write_text(f"mtllib gone.mtl a.mtl b.mtl\n{TWO_MATERIALS}")
    libraries(tmp_path, "a", "b")
    mesh, notes = read(tmp_path / "head.obj")
    assert all(m.texture for m in mesh.materials)
    assert "'gone.mtl' is missing" in notes[0]


def test_the_number_of_material_files_has_an_end(tmp_path: Path) -> None:
    (tmp_path / "head.obj").write_text("".join(f"mtllib {i}.mtl\n" for i in range(100)) + TWO_MATERIALS)
    (skipped,) = find_heads(tmp_path / "head.obj").skipped
    assert "more than 32" in skipped.reason


def test_another_name_of_the_only_material_is_noted(tmp_path: Path) -> None:
    path = textured_obj(tmp_path / "a")
    path.write_text(path.read_text().replace("usemtl skin", "usemtl face"))
    mesh, notes = read(path)
    assert mesh.materials[0].texture
    assert any("'face' is not in the material file; drawn as 'skin'" in note for note in notes)


def test_a_texture_of_ambient_light_alone_is_drawn_and_noted(tmp_path: Path) -> None:
    path = textured_obj(tmp_path)
    (tmp_path / "head.mtl").write_text("newmtl skin\nKa 1 1 1\nmap_Ka skin.png\n")
    mesh, notes = read(path)
    assert mesh.materials[0].texture == tmp_path / "skin.png"
    assert any("map_Ka alone" in note for note in notes)


@pytest.mark.parametrize(
    "order", ["map_Kd skin.png\nmap_Ka gone.png\n", "map_Ka gone.png\nmap_Kd skin.png\n"]
)
def test_beside_a_texture_that_of_ambient_light_is_ignored(tmp_path: Path, order: str) -> None:
    path = textured_obj(tmp_path)
    (tmp_path / "head.mtl").write_text(f"newmtl skin\n{order}map_Ka\n")
    mesh, notes = read(path)
    assert mesh.materials[0].texture == tmp_path / "skin.png"
    assert notes == ("licence unknown",)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ("1.0000001 0.8 0.6", (1, 0.8, 0.6)),
        ("1.4 0.8 0.6", (1, 0.8, 0.6)),
        ("2 1 0", (2 / 255, 1 / 255, 0)),
        ("255 127.5 0", (1, 0.5, 0)),
        ("255.00001 51 0", (1, 0.2, 0)),
    ],
)
def test_the_range_of_vertex_colours(tmp_path: Path, values: str, expected: tuple[float, ...]) -> None:
    lines = [f"{line} {values}" for line in TETRAHEDRON.splitlines()]
    (tmp_path / "head.obj").write_text("\n".join(lines) + "\n" + FACES)
    mesh, _ = read(tmp_path / "head.obj")
    assert mesh.vertex_colors is not None
    np.testing.assert_allclose(mesh.vertex_colors, [expected] * 4, atol=1e-6)


def test_vertex_colours_of_no_range_are_refused(tmp_path: Path) -> None:
    lines = [f"{line} 65535 0 0" for line in TETRAHEDRON.splitlines()]
    (tmp_path / "head.obj").write_text("\n".join(lines) + "\n" + FACES)
    with pytest.raises(HeadError, match="a vertex colour is 65535; write them as 0-1 or as 0-255"):
        read(tmp_path / "head.obj")


def test_textured_faces_without_coordinates_are_noted(tmp_path: Path) -> None:
    path = textured_obj(tmp_path)
    path.write_text(path.read_text() + "f 1 2 3\n")
    _, notes = read(path)
    assert "1 triangles of the textured 'skin' have no texture coordinates" in notes


@pytest.mark.parametrize(
    ("u", "v", "option", "wrap"),
    [
        (5, -1, "", "extend"),
        (0.4, 0, "", "extend"),
        (0.7, 0, "", "repeat"),
        (5, -1, "-clamp on ", "extend"),
        (0.7, 0, "-clamp on ", "extend"),
        (0.7, 0, "-clamp off ", "repeat"),
    ],
)
def test_a_texture_goes_on_beyond_its_border(
    tmp_path: Path, u: float, v: float, option: str, wrap: str
) -> None:
    path = textured_obj(tmp_path, f"{option}-o {u} {v} skin.png")
    mesh, _ = read(path)
    assert mesh.materials[0].wrap == wrap
    assert mesh.uv is not None
    moved = option.startswith("-clamp on") or wrap == "repeat"
    expected = np.array([0.1 + u, 0.1 + v] if moved else [0.1 + u % 1, 0.1])
    np.testing.assert_allclose(mesh.uv.min((0, 1)), expected, atol=1e-6)
    assert TEXTURED_FACES in path.read_text()


SHELL = f"mtllib head.mtl\n{TETRAHEDRON}{UV}usemtl skin\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\n"
SHELL += "usemtl cornea\nf 1/1 4/2 3/3\n"


def _opacity(path: Path, value: int, hole: int | None = None) -> None:
    """16 x 16 pixels; the triangles use the lower left, of which a part is the hole."""
    image = Image.new("L", (16, 16), value)
    if hole is not None:
        image.paste(hole, (2, 10, 5, 15))
    image.save(path)


@pytest.mark.parametrize(
    ("cornea", "drawn"),
    [
        ("d 0.1", False),
        ("d 0.1\nmap_Kd skin.png", False),
        ("Tr 0.9", False),
        ("Tr 0.9\nmap_Kd skin.png", False),
        ("map_d clear.png", False),
        ("map_Kd skin.png\nmap_d clear.png", False),
        ("map_d clear_in_alpha.png", False),
        ("d 0.1\nmap_d solid.png\nmap_Kd skin.png", True),
        ("Tr 1\nd 1", True),  # of the two d is meant
        ("d 0.6", True),
        ("Tr 0.4", True),
        ("map_d solid.png", True),
        ("map_Kd skin.png\nmap_d holes.png", True),
        ("Kd 0.2 0.4 0.6\nmap_d holes.png", True),
    ],
)
def test_shells_that_one_looks_through_are_left_out(tmp_path: Path, cornea: str, drawn: bool) -> None:
    Image.new("RGB", (8, 8), (200, 150, 130)).save(tmp_path / "skin.png")
    _opacity(tmp_path / "clear.png", 20)
    _opacity(tmp_path / "solid.png", 255)
    _opacity(tmp_path / "holes.png", 255, 0)
    Image.new("RGBA", (8, 8), (255, 255, 255, 20)).save(tmp_path / "clear_in_alpha.png")
    (tmp_path / "head.obj").write_text(SHELL)
    (tmp_path / "head.mtl").write_text(f"newmtl skin\nKd 1 1 1\nnewmtl cornea\nKd 1 1 1\n{cornea}\n")
    mesh, notes = read(tmp_path / "head.obj")
    assert len(mesh.triangles) == 2 + drawn
    assert ("the see-through material 'cornea' is left out" in notes) is not drawn
    if "holes" in cornea:
        assert mesh.materials[1].cutout and mesh.materials[1].texture is not None
    if cornea.startswith("Kd"):
        with Image.open(mesh.materials[1].texture) as image:  # type: ignore[arg-type]
            assert image.convert("RGBA").getpixel((15, 0)) == (51, 102, 153, 255)
            assert image.convert("RGBA").getpixel((3, 12))[3] == 0  # type: ignore[index]


@pytest.mark.parametrize("opacity", ["d 0", "Tr 1", "Tr 0.8"])
def test_a_head_of_nothing_but_shells_is_written_the_other_way_round(tmp_path: Path, opacity: str) -> None:
    (tmp_path / "head.obj").write_text(SHELL)
    materials = (f"newmtl {name}\nKd 1 1 1\n{opacity}\n" for name in ("skin", "cornea"))
    (tmp_path / "head.mtl").write_text("".join(materials))
    mesh, notes = read(tmp_path / "head.obj")
    assert len(mesh.triangles) == 3
    assert not any("see-through" in note for note in notes)


def test_an_opacity_map_without_texture_coordinates_hides_nothing(tmp_path: Path) -> None:
    _opacity(tmp_path / "clear.png", 255, 0)
    (tmp_path / "head.obj").write_text(f"mtllib head.mtl\n{TETRAHEDRON}usemtl skin\n{FACES}")
    (tmp_path / "head.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_d clear.png\n")
    assert len(read(tmp_path / "head.obj")[0].triangles) == 4


@pytest.mark.parametrize("map_kd", ["", "map_Kd skin.png\n"])
def test_an_emissive_texture_alone_is_noted(tmp_path: Path, map_kd: str) -> None:
    path = textured_obj(tmp_path)
    (tmp_path / "head.mtl").write_text(f"newmtl skin\nKd 0 0 0\n{map_kd}map_Ke skin.png\n")
    _, notes = read(path)
    assert ("the emissive texture of 'skin' is not drawn" in notes) is not bool(map_kd)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a mesh is the head's, what stands apart, and what is to be left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_meshes import textured_obj

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh, Material
from generator.heads.placement import Placement
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.heads.surroundings import clusters, head_alone, surroundings

Part = tuple[np.ndarray, np.ndarray]
RADIUS = 120.0


def ball(centre: tuple[float, float, float], radius: float, rings: int = 16) -> Part:
    """A closed surface."""
    polar, around = np.meshgrid(
        np.linspace(0.05, np.pi - 0.05, rings),
        np.linspace(0, 2 * np.pi, rings, endpoint=False),
        indexing="ij",
    )
    directions = np.stack(
        [np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1
    )
    return directions.reshape(-1, 3) * radius + centre, _grid(rings, rings, wrap=True)


def sheet(corner: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...], steps: int = 30) -> Part:
    """A flat grid of steps x steps points."""
    a, b = np.meshgrid(np.linspace(0, 1, steps), np.linspace(0, 1, steps), indexing="ij")
    points = np.array(corner) + a[..., None] * np.array(u) + b[..., None] * np.array(v)
    return points.reshape(-1, 3), _grid(steps, steps, wrap=False)


def _grid(rows: int, columns: int, *, wrap: bool) -> np.ndarray:
    found = []
    for i in range(rows - 1):
        for j in range(columns if wrap else columns - 1):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            found += [(a, b, a + columns), (b, b + columns, a + columns)]
    return np.array(found)


def mesh_of(*parts: Part) -> HeadMesh:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    triangles = np.concatenate([t + start for (_, t), start in zip(parts, starts, strict=False)])
    return HeadMesh(
        np.concatenate([points for points, _ in parts]).astype(np.float64),
        triangles.astype(np.int32),
        None,
        None,
        np.zeros(len(triangles), dtype=np.int32),
        (Material("skin"),),
    )


HEAD = ball((0, 0, 0), RADIUS)
BELONGS = {
    "an eye": ball((30, 20, 100), 12),
    "glasses": sheet((-60, 0, 125), (120, 0, 0), (0, 40, 0), 4),
    "a shirt": ball((0, -330, 0), 205),
    "hair cards": sheet((-60, -300, -126), (120, 0, 0), (0, 320, 0)),
}
APART = {
    "a stray triangle": (np.array([[1700.0, 0, 0], [1705, 0, 0], [1700, 5, 0]]), np.array([[0, 1, 2]])),
    "a floor": sheet((-1000, -125, -1000), (2000, 0, 0), (0, 0, 2000)),
    "a backdrop": sheet((-1000, -1000, -140), (2000, 0, 0), (0, 2000, 0)),
    "a backdrop of two triangles": sheet((-1000, -1000, -140), (2000, 0, 0), (0, 2000, 0), 2),
    "a slanting wall": sheet((-1000, -1000, -140), (2000, 0, -300), (0, 2000, -300)),
    "a second head": ball((300, 10, 0), RADIUS),
}


@pytest.mark.parametrize("part", BELONGS.values(), ids=BELONGS.keys())
def test_what_is_worn_is_the_heads(part: Part) -> None:
    assert surroundings(mesh_of(HEAD, part), np.zeros(3), RADIUS).all()


@pytest.mark.parametrize("part", APART.values(), ids=APART.keys())
def test_what_stands_apart_is_not(part: Part) -> None:
    mesh = mesh_of(HEAD, part)
    kept = surroundings(mesh, np.zeros(3), RADIUS)
    assert kept.tolist() == [k < len(HEAD[1]) for k in range(len(kept))]
    placement = Placement("cm", 10.0, "+Y", "+Z", (0.0, 0.0, 0.0), RADIUS * 10, 90.0)
    alone = head_alone(mesh, placement)
    np.testing.assert_array_equal(alone.vertices, mesh.vertices[: len(HEAD[0])])
    np.testing.assert_array_equal(alone.triangles, HEAD[1])


def test_a_mesh_that_is_all_head_is_the_very_same() -> None:
    mesh = mesh_of(HEAD, BELONGS["an eye"])
    assert head_alone(mesh, Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), RADIUS, 90.0)) is mesh
    assert clusters(mesh, 3) == []


def test_groups_that_lie_apart_come_with_the_largest_first() -> None:
    small = ball((2000, 0, 0), 100, rings=8)
    groups = clusters(mesh_of(small, HEAD, BELONGS["an eye"]), 2)
    assert [len(group.triangles) for group in groups] == [2 * len(HEAD[1]), len(small[1])]


def test_a_material_is_left_out_by_its_name(tmp_path: Path) -> None:
    obj = textured_obj(tmp_path / "h")
    text = obj.read_text().replace("f 2/1 3/2 4/3", "usemtl lashes\nf 2/1 3/2 4/3")
    obj.write_text(text)
    mtl = tmp_path / "h" / "head.mtl"
    mtl.write_text(mtl.read_text() + "newmtl lashes\nKd 0 0 0\n")

    def read(*names: str) -> HeadMesh:
        [head] = find_heads(obj, without=names).heads
        return read_mesh(head, tmp_path)

    assert (len(read().triangles), len(read("lashes").triangles)) == (4, 3)
    with pytest.raises(HeadError, match=r"head\.obj: no material 'lash' to leave out; there are: .*'lashes'"):
        read("lash")
    with pytest.raises(HeadError, match="every triangle"):
        read("lashes", "skin")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Eye holes are found, filled, and the balls stay behind the lids."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from facescape_fixture import FixtureHead, _ellipsoid, fixture_head

from generator.heads.boundary import boundary_loops, find_face_holes
from generator.heads.eyeballs import add_eyeballs, paint_eye
from generator.heads.mesh import HeadMesh, Material
from generator.heads.weld import weld


def _mesh(head: FixtureHead, squeeze: float = 1.0) -> HeadMesh:
    """squeeze < 1 closes the eyes: heights near the eyes shrink towards the eyes' line."""
    corner = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = head.quads[:, corner].reshape(-1, 3).astype(np.int32)
    vertices = np.round(head.vertices, 6)
    mesh = HeadMesh(
        vertices=vertices,
        triangles=triangles,
        uv=head.uv[head.quad_uv[:, corner].reshape(-1, 3)].astype(np.float32),
        vertex_colors=None,
        material_index=np.zeros(len(triangles), dtype=np.int32),
        materials=(Material("skin"),),
    )
    mesh = weld(mesh)
    holes = find_face_holes(mesh.vertices, mesh.triangles)
    assert holes is not None
    moved = mesh.vertices.copy()
    for loop in (holes.left, holes.right):
        middle = moved[loop, 1].mean()
        moved[loop, 1] = middle + squeeze * (moved[loop, 1] - middle)
    return replace(mesh, vertices=moved)


HEADS = {"face": fixture_head, "ellipsoid": _ellipsoid}


@pytest.mark.slow
@pytest.mark.parametrize("kind", HEADS)
@pytest.mark.parametrize("squeeze", [1.0, 0.02])
def test_balls_fill_the_holes_and_do_not_pierce_the_lids(tmp_path: Path, kind: str, squeeze: float) -> None:
    mesh = _mesh(HEADS[kind](), squeeze)
    holes = find_face_holes(mesh.vertices, mesh.triangles)
    assert holes is not None
    assert holes.mouth is not None
    filled = add_eyeballs(mesh, tmp_path)
    ball = filled.vertices[filled.triangles[filled.material_index == 1]].mean(1)
    for side, loop in ((1, holes.left), (-1, holes.right)):
        lid = mesh.vertices[loop]
        assert (side * lid[:, 0] > 0).all()
        one = ball[side * ball[:, 0] > 0]
        centre, radius = (one.min(0) + one.max(0)) / 2, np.ptp(one[:, 2]) / 2
        assert 8.0 < radius < 12.1
        assert np.abs(centre[:2] - lid[:, :2].mean(0)).max() < 4
        surface = mesh.vertices[mesh.triangles].mean(1)
        assert np.linalg.norm(surface - centre, axis=1).min() > radius
        assert np.linalg.norm(lid - centre, axis=1).max() < radius + 9


def test_only_the_neck_stays_open_and_everything_faces_outwards(tmp_path: Path) -> None:
    filled = add_eyeballs(_mesh(fixture_head()), tmp_path)
    loops = [filled.vertices[loop] for loop in boundary_loops(filled.triangles)]
    # Left open: the neck, and the lids' inner rims inside of the balls.
    assert len(loops) == 3
    for material in (1, 3):
        triangles = filled.triangles[filled.material_index == material]
        corners = filled.vertices[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if material == 1:
            assert trimesh.Trimesh(filled.vertices, triangles, process=False).volume > 0
        else:
            assert normal[:, 2].sum() > 0


def test_the_eye_looks_forward_and_its_texture_is_deterministic(tmp_path: Path) -> None:
    filled = add_eyeballs(_mesh(fixture_head()), tmp_path)
    of_ball = filled.material_index == 1
    assert filled.uv is not None
    front = filled.vertices[filled.triangles[of_ball]][..., 2]
    most = np.unravel_index(np.argmax(front), front.shape)
    np.testing.assert_allclose(filled.uv[of_ball][most], [0.5, 0.5], atol=1e-6)
    paint_eye(tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "eye.png").read_bytes()


def test_a_head_without_eye_holes_says_so(tmp_path: Path) -> None:
    box = trimesh.creation.icosphere(radius=100)
    faces = np.asarray(box.faces, dtype=np.int32)
    index = np.zeros(len(faces), dtype=np.int32)
    mesh = HeadMesh(np.asarray(box.vertices), faces, None, None, index, (Material("skin"),))
    filled = add_eyeballs(mesh, tmp_path)
    assert len(filled.triangles) == len(faces)
    assert "no eyeballs" in filled.problems[0]

# SPDX-License-Identifier: GPL-3.0-or-later
"""How open vertices are, against shapes of which it is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import load_package, save_package
from generator.landmarks.occlusion import with_occlusion


def grid(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of vertices, int32 [T, 3]."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = row * columns + column
    faces = [np.stack([a, a + columns, a + columns + 1], -1), np.stack([a, a + columns + 1, a + 1], -1)]
    return np.concatenate(faces).reshape(-1, 3).astype(np.int32)


def mesh_of(vertices: np.ndarray, triangles: np.ndarray, **more: object) -> HeadMesh:
    index = np.zeros(len(triangles), np.int32)
    given: dict = {"uv": None, "materials": (Material("skin"),), **more}
    return HeadMesh(vertices, triangles, vertex_colors=None, material_index=index, **given)


def bowl(opening_deg: float, shell: bool = True) -> HeadMesh:
    """A ball of 80 mm, seen from within, without the cap about +y. shell: another keeps its back dark."""
    polar, around = np.meshgrid(
        np.deg2rad(np.linspace(opening_deg, 179, 60)), np.linspace(0, 2 * np.pi, 91), indexing="ij"
    )
    points = np.stack(
        [np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1
    )
    points, faces = points.reshape(-1, 3), grid(60, 91)
    if not shell:
        return mesh_of(80 * points, faces)
    both = np.concatenate([faces, faces[:, ::-1] + len(points)]).astype(np.int32)
    return mesh_of(np.concatenate([80 * points, 81 * points]), both)


@pytest.mark.parametrize("opening", [40.0, 90.0, 120.0])
def test_in_a_bowl_it_is_the_share_of_the_sphere_that_is_missing(opening: float) -> None:
    """Any part of a sphere is seen from within as its share of the area, from everywhere."""
    found = with_occlusion(bowl(opening)).openness
    assert found is not None and found.dtype == np.float32
    inside = found[: 60 * 91].reshape(60, 91)[4:-3]
    assert inside.mean() == pytest.approx((1 - np.cos(np.deg2rad(opening))) / 2, abs=0.015)
    assert inside.std() < 0.03


def test_a_sheet_is_as_open_as_its_outer_side() -> None:
    """All but closed within, and seen by everybody from without: a curtain is no shadow."""
    found = with_occlusion(bowl(20.0, shell=False)).openness
    assert found is not None and found.reshape(60, 91)[4:-3].min() > 0.95


def floor_and_wall(height: float) -> HeadMesh:
    """A floor of a metre that ends at a wall at x = 0; frame U, y up."""
    along = np.linspace(-500, 500, 81)
    x, z = np.meshgrid(np.linspace(0, 400, 81), along, indexing="ij")
    floor = np.stack([x, 0 * x, z], -1).reshape(-1, 3)
    y, z = np.meshgrid([0.0, height], 10 * along, indexing="ij")
    wall = np.stack([0 * y, y, z], -1).reshape(-1, 3)
    # Wound so that the floor looks up.
    triangles = np.concatenate([grid(81, 81)[:, ::-1], grid(2, 81) + len(floor)])
    return mesh_of(np.concatenate([floor, wall]), triangles.astype(np.int32))


def test_beside_a_wall_it_is_what_the_wall_leaves_of_the_sky() -> None:
    """1/2 (1 + d / sqrt(d^2 + h^2)) at d from a long wall of height h: half at the foot of a high one."""
    for height in (40.0, 20_000.0):
        found = with_occlusion(floor_and_wall(height)).openness
        assert found is not None
        at = found[: 81 * 81].reshape(81, 81)[3:60, 30:50].mean(axis=1)
        distance = np.linspace(0, 400, 81)[3:60]
        expected = (1 + distance / np.hypot(distance, height)) / 2
        np.testing.assert_allclose(at, expected, atol=0.03)


def test_holes_let_light_through(tmp_path: Path) -> None:
    """A wall of which the texture is cut out shades nothing."""
    Image.fromarray(np.zeros((4, 4, 4), np.uint8)).save(tmp_path / "hole.png")
    solid = floor_and_wall(20_000.0)
    index = (np.arange(len(solid.triangles)) >= len(grid(81, 81))).astype(np.int32)
    clear = HeadMesh(
        solid.vertices,
        solid.triangles,
        np.zeros((len(solid.triangles), 3, 2), np.float32),
        None,
        index,
        (Material("skin"), Material("hole", texture=tmp_path / "hole.png", cutout=True)),
    )
    found = with_occlusion(clear).openness
    assert found is not None and found[: 81 * 81].min() == 1.0


def test_it_is_the_same_every_time_and_goes_with_the_package(tmp_path: Path) -> None:
    mesh = bowl(70.0)
    once, again = with_occlusion(mesh), with_occlusion(mesh)
    np.testing.assert_array_equal(once.openness, again.openness)
    save_package(once, tmp_path / "with.npz")
    save_package(mesh, tmp_path / "without.npz")
    np.testing.assert_array_equal(load_package(tmp_path / "with.npz").openness, once.openness)
    assert load_package(tmp_path / "without.npz").openness is None

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a texture is used beyond its image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import load_package, save_package
from generator.heads.tiling import EXTEND, MIRROR, REPEAT, bring_back, needs_both, texels

TRIANGLE = np.array([[[0.2, 0.3], [0.9, 0.3], [0.2, 0.8]]])


@pytest.mark.parametrize("tile", [(0, 0), (5, -1), (-3, 12)])
def test_a_triangle_of_another_tile_comes_back(tile: tuple[int, int]) -> None:
    uv, wrap = bring_back(TRIANGLE + tile, (REPEAT, REPEAT))
    np.testing.assert_allclose(uv, TRIANGLE, atol=1e-9)
    assert wrap == EXTEND


def test_a_border_that_was_rounded_stays() -> None:
    uv = np.array([[[0.0, -1e-6], [1.0000001, 0], [0, 1]], [[5, 0], [6.0000001, 0], [5, 1]]])
    back, wrap = bring_back(uv, (REPEAT, REPEAT))
    np.testing.assert_array_equal(back[0], uv[0])
    np.testing.assert_allclose(back[1], [[0, 0], [1, 0], [0, 1]], atol=1e-6)
    assert wrap == EXTEND


def test_a_mirrored_tile_comes_back_mirrored() -> None:
    uv, wrap = bring_back(TRIANGLE + np.array((1, 2)), (MIRROR, MIRROR))
    np.testing.assert_allclose(uv[..., 0], 1 - TRIANGLE[..., 0])
    np.testing.assert_allclose(uv[..., 1], TRIANGLE[..., 1])
    assert wrap == EXTEND


def test_across_tiles_the_texture_must_go_on() -> None:
    across = TRIANGLE * (3, 1)
    assert bring_back(across, (REPEAT, EXTEND))[1] == REPEAT
    assert bring_back(across, (EXTEND, REPEAT))[1] == EXTEND
    assert bring_back(across, (MIRROR, REPEAT))[1] == MIRROR
    assert not needs_both(across, (MIRROR, REPEAT))
    assert needs_both(TRIANGLE * 3, (MIRROR, REPEAT))
    assert not needs_both(TRIANGLE * 3, (REPEAT, REPEAT))


@pytest.mark.parametrize(
    ("wrap", "column"),
    [(EXTEND, [0, 0, 1, 3, 3, 3]), (REPEAT, [3, 0, 1, 0, 3, 0]), (MIRROR, [0, 0, 1, 3, 0, 0])],
)
def test_the_pixel_of_a_coordinate(wrap: str, column: list[int]) -> None:
    u = np.array([-0.1, 0.1, 0.3, 1.1, 1.9, 2.1])
    rows, columns = texels(np.stack([u, np.full(6, 0.9)], axis=1), wrap, (4, 4))
    assert columns.tolist() == column
    assert rows.tolist() == [0] * 6


def test_a_package_keeps_it_and_an_old_one_means_what_it_meant(tmp_path: Path) -> None:
    material = Material("skin", (0.1, 0.2, 0.3), tmp_path / "a.png", True, (0.5, 0.25, 1.0), True, MIRROR)
    mesh = HeadMesh(
        np.eye(3),
        np.array([[0, 1, 2]]),
        TRIANGLE.astype(np.float32),
        np.ones((3, 3)),
        np.zeros(1, int),
        (material,),
    )
    save_package(mesh, tmp_path / "new.npz")
    assert load_package(tmp_path / "new.npz").materials == (material,)
    with np.load(tmp_path / "new.npz") as data:
        arrays = dict(data)
    text = '[{"name": "skin", "base_color": [1, 1, 1], "texture": "/a.png", "cutout": false}]'
    np.savez(tmp_path / "old.npz", **{**arrays, "materials": np.array(text)})
    assert load_package(tmp_path / "old.npz").materials == (Material("skin", (1, 1, 1), Path("/a.png")),)

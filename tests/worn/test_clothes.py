# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes on heads of three sources: shoulders of a usual width, and a neck without a gap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from soft_heads import SOURCES, soft_fits

from generator.heads.mesh import HeadMesh
from generator.labels import CLOTHES, SKIN
from generator.plan.wear import STYLES
from generator.worn.clothes import KIND
from generator.worn.fit import CannotWear, Fit
from generator.worn.garments import GARMENTS
from generator.worn.torso import find_torso

GARMENT_STYLES = STYLES["clothes"][1:]
MOST_TRIANGLES = 22_000
EDGE_MM = 5.0
"""How far the sharp edge where a bust is cut off may stick out."""


def made(fit: Fit, style: str, seed: int = 3) -> HeadMesh:
    return KIND.make(fit, style, np.random.default_rng(seed))


def together(head: HeadMesh, worn: HeadMesh) -> HeadMesh:
    """One mesh of both, for rays."""
    triangles = np.concatenate([head.triangles, worn.triangles + len(head.vertices)])
    index = np.zeros(len(triangles), np.int32)
    vertices = np.concatenate([head.vertices, worn.vertices])
    return HeadMesh(vertices, triangles, None, None, index, head.materials)


def test_every_style_has_a_garment() -> None:
    assert set(GARMENT_STYLES) == set(GARMENTS)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("style", GARMENT_STYLES)
def test_clothes_join_the_neck(source: str, style: str) -> None:
    fit = soft_fits()[source]
    worn = made(fit, style)
    assert np.isfinite(worn.vertices).all() and len(worn.triangles) <= MOST_TRIANGLES
    assert [material.label for material in worn.materials] == [CLOTHES, SKIN]
    torso = find_torso(fit)
    cloth = worn.vertices[np.unique(worn.triangles[worn.material_index == 0])]
    own = np.ptp(fit.mesh.vertices[:, 0]) + 30
    assert 390 * torso.scale < np.ptp(cloth[:, 0]) < max(460 * torso.scale, own)
    # From every side, from the chin to the chest, something is before the axis of the neck.
    both = Fit(together(fit.mesh, worn), fit.points)
    turn = np.radians(np.arange(0, 360, 4))
    out = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    for down in (5, 20, 35, 50, 65, 80, 120):
        centre = np.array([torso.axis[0], torso.chin - down * torso.scale, torso.axis[1]])
        reach = both.outermost(centre, out)
        assert (reach > 25 * torso.scale).all(), down
    # Nor does one who looks down at a collar look past the neck.
    for down in (0.3, 0.8):
        centre = np.array([torso.axis[0], torso.chin - 45 * torso.scale, torso.axis[1]])
        above = out + np.array([0, down, 0])
        above /= np.linalg.norm(above, axis=1, keepdims=True)
        assert (both.outermost(centre, above) > 25 * torso.scale).all()


@pytest.mark.parametrize("source", SOURCES)
def test_cloth_is_outside_of_the_body(source: str) -> None:
    fit = soft_fits()[source]
    torso = find_torso(fit)
    worn = made(fit, "crew")
    cloth = replace(
        worn,
        triangles=worn.triangles[worn.material_index == 0],
        material_index=worn.material_index[worn.material_index == 0],
    )
    turn = np.radians(np.arange(0, 360, 6))
    out = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    for down in (130, 160, 200):
        centre = np.array([torso.axis[0], torso.chin - down * torso.scale, torso.axis[1]])
        own = fit.outermost(centre, out)
        there = np.isfinite(own) & (own > 0)
        assert (Fit(cloth, fit.points).outermost(centre, out)[there] > own[there] - EDGE_MM).all()


def test_the_neck_has_the_heads_own_colour() -> None:
    fit = soft_fits()["bust"]
    worn = made(fit, "crew")
    assert worn.vertex_colors is not None
    neck = worn.vertex_colors[np.unique(worn.triangles[worn.material_index == 1])]
    assert np.abs(neck.max(axis=0) - fit.mesh.materials[0].base_color).max() < 0.02


def test_clothes_are_drawn_from_their_generator() -> None:
    fit = soft_fits()["parametric"]
    one, again, other = made(fit, "shirt"), made(fit, "shirt"), made(fit, "shirt", seed=4)
    assert (one.vertices.round(4) == again.vertices.round(4)).all()
    assert (one.vertex_colors == again.vertex_colors).all() and (
        one.vertex_colors != other.vertex_colors
    ).any()


def test_a_head_without_landmarks_wears_none() -> None:
    fit = soft_fits()["bust"]
    with pytest.raises(CannotWear, match="landmark"):
        made(replace(fit, points=np.full_like(fit.points, np.nan)), "crew")

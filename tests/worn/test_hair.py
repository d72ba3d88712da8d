# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair on heads of three sources: it covers the scalp and not the face, and makes room for a hat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from soft_heads import SOURCES, soft_fits

from generator.heads.mesh import HeadMesh, Material
from generator.labels import HAIR
from generator.plan.wear import STYLES
from generator.worn.cuts import CUTS
from generator.worn.fit import CannotWear, Fit
from generator.worn.hair import KIND
from generator.worn.skull import find_skull

CUT_STYLES = STYLES["hair"][1:]
MOST_TRIANGLES = 26_000
FACE = (1, 4, 33, 133, 159, 263, 362, 386, 50, 280, 0, 13, 17, 61, 291, 152)


def made(fit: Fit, style: str, seed: int = 3, **others: str) -> HeadMesh:
    return KIND.make(fit.beside(others), style, np.random.default_rng(seed))


def standing_off(fit: Fit, hair: HeadMesh) -> np.ndarray:
    """How far hair is from the skull, mm, [V]."""
    skull = find_skull(fit)
    return np.linalg.norm(hair.vertices - skull.centre, axis=1) - skull.radius(hair.vertices)


def test_every_style_has_a_cut() -> None:
    assert set(CUT_STYLES) == set(CUTS)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("style", CUT_STYLES)
def test_hair_covers_the_scalp_and_leaves_the_face_free(source: str, style: str) -> None:
    fit = soft_fits()[source]
    hair = made(fit, style)
    assert np.isfinite(hair.vertices).all() and len(hair.triangles) <= MOST_TRIANGLES
    assert {material.label for material in hair.materials} == {HAIR}
    worn = Fit(hair, fit.points)
    skull = find_skull(fit)
    turn, rise = np.meshgrid(np.linspace(-3.1, 3.1, 25), np.linspace(0, 1, 9))
    line = skull.hairline(turn)
    rise = np.minimum(line + np.radians(6) + rise * (np.pi / 2 - line), 1.55)
    out = (skull.point(turn, rise) - skull.centre).reshape(-1, 3)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    assert (worn.outermost(skull.centre, out) > fit.outermost(skull.centre, out)).all()
    # From in front, a little from above and from below, nothing of the face is behind hair.
    marks = fit.at(*FACE)
    for down in (-0.25, 0.0, 0.25):
        towards = np.array([0.0, down, -1.0]) / np.hypot(1, down)
        ahead = worn.cast(marks - 500 * towards, np.tile(towards, (len(marks), 1)))
        hidden = ((ahead - marks) @ towards) < -2.0
        assert not hidden.any(), (down, np.array(FACE)[hidden])


@pytest.mark.parametrize("style", ["buzz", "fringe", "curly", "bun"])
def test_hair_is_drawn_from_its_generator(style: str) -> None:
    fit = soft_fits()["bust"]
    one, again, other = made(fit, style), made(fit, style), made(fit, style, seed=4)
    assert (one.vertices.round(4) == again.vertices.round(4)).all()
    assert (one.vertex_colors == again.vertex_colors).all()
    assert one.vertices.shape != other.vertices.shape or (one.vertices != other.vertices).any()


@pytest.mark.parametrize("style", ["short", "fringe", "long", "afro", "ponytail"])
def test_hair_is_flat_under_a_hat(style: str) -> None:
    fit = soft_fits()["bust"]
    top = find_skull(fit).centre[1] + 55
    free, pressed = made(fit, style), made(fit, style, headwear="cap")
    above = pressed.vertices[:, 1] > top
    assert standing_off(fit, pressed)[above].max() < 4.5
    assert standing_off(fit, free)[free.vertices[:, 1] > top].max() > 7


def test_no_hair_under_a_headscarf() -> None:
    with pytest.raises(CannotWear, match="headscarf"):
        made(soft_fits()["bust"], "short", headwear="headscarf")


def test_tips_break_the_outline() -> None:
    """Seen from behind, the outline is no smooth shell."""
    fit = soft_fits()["bust"]
    hair = made(fit, "short")
    turn = np.radians(np.arange(-60, 60, 0.5))
    # The silhouette at each angle: how far hair reaches in thin slices.
    away = hair.vertices - find_skull(fit).centre
    angle = np.arctan2(away[:, 0], away[:, 1])
    far = np.hypot(away[:, 0], away[:, 1])
    outline = [far[np.abs(angle - one) < 0.01].max() for one in turn]
    assert np.abs(np.diff(outline)).mean() > 0.4


def test_a_painted_cap_is_covered_in_its_own_colour() -> None:
    fit = soft_fits()["facescape"]
    hair = made(fit, "bob")
    assert hair.vertex_colors is not None and hair.vertex_colors.mean() < 0.35


def test_a_head_that_cannot_have_hair_says_why() -> None:
    fit = soft_fits()["bust"]
    with pytest.raises(CannotWear, match="landmark"):
        made(replace(fit, points=np.full_like(fit.points, np.nan)), "short")
    face = fit.mesh.vertices[fit.mesh.triangles][..., 2].min(axis=1) > 20
    mask = replace(fit.mesh, triangles=fit.mesh.triangles[face], material_index=fit.mesh.material_index[face])
    with pytest.raises(CannotWear, match="no back"):
        made(Fit(mask, fit.points), "short")
    own = replace(fit.mesh, materials=(*fit.mesh.materials, Material("hair")))
    with pytest.raises(CannotWear, match="of its own"):
        made(Fit(own, fit.points), "short")
    assert len(made(Fit(own, fit.points), "long").triangles)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Beards, brows and lashes on heads of three sources: with depth, in their place, and never over the lips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from soft_heads import SOURCES, soft_fits

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.mesh import HeadMesh
from generator.labels import BEARD, BROWS
from generator.plan.wear import STYLES
from generator.worn import beard, brows
from generator.worn.fit import CannotWear, Fit

LIPS = (61, 40, 37, 0, 267, 270, 291, 321, 314, 17, 84, 91, 13, 14, 78, 308)
MOST_TRIANGLES = 22_000


def made(kind: str, fit: Fit, style: str, seed: int = 3, **others: str) -> HeadMesh:
    maker = {"beard": beard, "brows": brows}[kind].KIND
    return maker.make(fit.beside(others), style, np.random.default_rng(seed))


def heights(fit: Fit, points: np.ndarray) -> np.ndarray:
    """How far points are from the head's surface, mm."""
    some = points[:: max(1, len(points) // 200)] @ CAMERA_FROM_GRAPHICS
    triangles, weights = fit.surface.nearest(some)
    return np.linalg.norm(fit.surface.points(triangles, weights) - some, axis=1)


def test_every_style_has_a_trim() -> None:
    assert set(STYLES["beard"][1:]) == set(beard.TRIMS) and set(STYLES["brows"][1:]) == set(brows.HAIRS)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("style", STYLES["beard"][1:])
def test_a_beard_leaves_the_lips_free(source: str, style: str) -> None:
    fit = soft_fits()[source]
    worn = made("beard", fit, style)
    assert np.isfinite(worn.vertices).all() and 500 < len(worn.triangles) <= MOST_TRIANGLES
    assert {material.label for material in worn.materials} == {BEARD}
    marks = fit.at(*LIPS)
    for yaw in (-0.3, 0.0, 0.3):
        towards = np.array([yaw, 0.0, -1.0]) / np.hypot(1, yaw)
        ahead = Fit(worn, fit.points).cast(marks - 300 * towards, np.tile(towards, (len(marks), 1)))
        hidden = ((ahead - marks) @ towards) < -1.0
        assert not hidden.any(), np.array(LIPS)[hidden]
    # From in front it covers the place below the nose or the chin.
    above, chin = fit.at(164)[0], fit.at(199)[0]
    around = [np.linalg.norm(worn.vertices - place, axis=1).min() for place in (above, chin)]
    assert around[0] < 4.5 and (style == "moustache" or around[1] < 4.5)


@pytest.mark.parametrize(("style", "low", "high"), [("stubble", 0.3, 3), ("full", 2.5, 15), ("long", 6, 70)])
def test_a_beard_has_depth(style: str, low: float, high: float) -> None:
    fit = soft_fits()["bust"]
    away = heights(fit, made("beard", fit, style).vertices)
    assert low < np.quantile(away, 0.9) < high


def test_no_long_beard_under_a_mask() -> None:
    fit = soft_fits()["bust"]
    with pytest.raises(CannotWear, match="mask"):
        made("beard", fit, "full", mask="medical")
    assert len(made("beard", fit, "stubble", mask="medical").triangles)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("style", STYLES["brows"][1:])
def test_brows_lie_where_brows_are(source: str, style: str) -> None:
    fit = soft_fits()[source]
    worn = made("brows", fit, style)
    assert np.isfinite(worn.vertices).all() and len(worn.triangles) < 5000
    assert {material.label for material in worn.materials} == {BROWS}
    places = fit.at(63, 105, 66, 293, 334, 296)
    assert all(np.linalg.norm(worn.vertices - place, axis=1).min() < 4 for place in places)
    assert heights(fit, worn.vertices).max() < 9
    # The eyes look out between brows and lashes.
    pupils = (fit.at(159, 386) + fit.at(145, 374)) / 2
    towards = np.tile([0.0, 0.0, -1.0], (2, 1))
    ahead = Fit(worn, fit.points).cast(pupils - 100 * towards, towards)
    assert not (ahead[:, 2] > pupils[:, 2] + 1).any()


@pytest.mark.parametrize(("kind", "style"), [("beard", "full"), ("brows", "thick")])
def test_they_are_drawn_from_their_generator(kind: str, style: str) -> None:
    fit = soft_fits()["parametric"]
    one, again, other = made(kind, fit, style), made(kind, fit, style), made(kind, fit, style, seed=4)
    assert (one.vertices.round(4) == again.vertices.round(4)).all()
    assert (one.vertex_colors == again.vertex_colors).all()
    assert one.vertices.shape != other.vertices.shape or (one.vertices != other.vertices).any()
    with pytest.raises(CannotWear, match="landmark"):
        made(kind, replace(fit, points=np.full_like(fit.points, np.nan)), style)

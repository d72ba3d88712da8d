# SPDX-License-Identifier: GPL-3.0-or-later
"""The wardrobe: what is made anew, what is kept, and what is left out with its reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from soft_heads import soft_fits

from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.mesh import HeadMesh
from generator.heads.package import load_package
from generator.plan.settings import Look
from generator.plan.views import View, Views
from generator.registries import WORN
from generator.worn.fit import Fit, Kind
from generator.worn.wardrobe import KEPT, Outfits, Wardrobe

FIT = soft_fits()["bust"]
MADE: list[tuple[str, dict[str, str]]] = []


def some(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """A triangle whose place is drawn."""
    MADE.append((style, dict(fit.others)))
    triangle = np.eye(3) + rng.uniform(0, 50, 3)
    zero = np.zeros(1, np.int32)
    return HeadMesh(triangle, np.array([[0, 1, 2]], np.int32), None, None, zero, (fit.mesh.materials[0],))


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    MADE.clear()
    monkeypatch.setitem(WORN._entries, "hair", Kind(some, minds=("headwear",)))
    for kind in ("headwear", "glasses", "occluder"):
        monkeypatch.setitem(WORN._entries, kind, Kind(some))


def dressed(wardrobe: Wardrobe, *looks: Look, points: np.ndarray | None = None) -> Outfits:
    views = Views.of([View((0.0, 0.0, 0.0), Camera.square(64, 85.0, 900.0), look) for look in looks])
    given = FIT.points if points is None else points
    return wardrobe.dress("amy/neutral", FIT.mesh, given @ CAMERA_FROM_GRAPHICS, views)


def places(outfits: Outfits) -> list[np.ndarray]:
    return [load_package(Path(one[0].package)).vertices for one in outfits.worn]


def test_what_minds_another_kind_is_made_anew_for_it_and_nothing_else_is(tmp_path: Path) -> None:
    wardrobe = Wardrobe(tmp_path / "worn")
    hair = Look(hair="short")
    dressed(wardrobe, hair, replace(hair, headwear="cap"), replace(hair, glasses="round"), hair)
    of_hair = [others for style, others in MADE if style == "short"]
    assert of_hair == [{"headwear": "none"}, {"headwear": "cap"}]
    assert len(MADE) == 4  # and a cap, and glasses


def test_a_variant_decides_and_is_the_same_again(tmp_path: Path) -> None:
    looks = [Look(glasses="round", wear_variant=variant) for variant in (0.1, 0.2, 0.1)]
    one, two, three = places(dressed(Wardrobe(tmp_path / "a"), *looks))
    assert np.array_equal(one, three) and not np.allclose(one, two)
    [again] = places(dressed(Wardrobe(tmp_path / "b"), looks[0]))
    assert np.array_equal(one, again), "whatever was made before"


def test_of_many_things_those_of_the_last_views_are_kept(tmp_path: Path) -> None:
    """Where every image has its own, a head of many images has no end of them."""
    wardrobe = Wardrobe(tmp_path / "worn")
    looks = [Look(glasses="round", wear_variant=number / 100) for number in range(KEPT + 2)]
    first = dressed(wardrobe, *looks[:-2])
    assert all(Path(one[0].package).exists() for one in first.worn)
    before = places(first)
    dressed(wardrobe, *looks[-2:])
    assert len([*(tmp_path / "worn").glob("*.npz")]) == 2
    [again] = places(dressed(wardrobe, looks[0]))
    assert np.array_equal(again, before[0]), "the same when it is made again"


def test_what_has_no_finite_shape_or_no_place_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
        made = some(fit, style, rng)
        made.vertices[0] = np.nan  # after what a mesh checks of itself
        return made

    monkeypatch.setitem(WORN._entries, "glasses", Kind(broken))
    points = FIT.points.copy()
    points[454] = np.nan
    look = Look(glasses="round", occluder="hand", headwear="cap")
    found = dressed(Wardrobe(tmp_path / "worn"), look, points=points)
    assert len(found.things[0]) == 1, "the cap stays"
    [reason] = found.left_out
    glasses, occluder = reason.split("; ")
    assert glasses == "glasses: what was made has no finite shape"
    assert occluder == "occluder: landmark 454 has no place on the mesh"


def test_up_is_up_and_right_is_right(tmp_path: Path) -> None:
    look = Look(occluder="hand", occluder_x=0.5, occluder_y=-0.25)
    [[(_, offset)]] = dressed(Wardrobe(tmp_path / "worn"), look).things
    width = np.linalg.norm(FIT.points[454] - FIT.points[234])
    assert np.allclose(offset, [0.5 * width, 0.25 * width, 0], atol=1e-3)

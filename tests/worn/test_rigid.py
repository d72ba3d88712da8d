# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses, masks, hats, headphones and occluders: on heads of three sources, where they belong."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from where import SOURCES, behind_front_mm, covers, of_material

from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.labels import GLASSES, HEADWEAR, MASK, OCCLUDER
from generator.placing.rendering import read_image
from generator.plan.config import load_config
from generator.plan.view_plan import plan_views
from generator.plan.views import Views
from generator.plan.wear import LENSES, STYLES, Worn
from generator.registries import WORN
from generator.worn.face import Face
from generator.worn.fit import CannotWear, Fit

if TYPE_CHECKING:
    from generator.execution.lanes.renderer import Renderer

LABELS = {
    "glasses": GLASSES,
    "mask": MASK,
    "headwear": HEADWEAR,
    "headphones": HEADWEAR,
    "occluder": OCCLUDER,
}
THINGS = [(kind, style) for kind in LABELS for style in STYLES[kind][1:]]
MOST_TRIANGLES = 6000


def make(fit: Fit, kind: str, style: str, seed: int = 3, **others: str) -> HeadMesh:
    """A thing on a head."""
    return WORN.get(kind).make(fit.beside(others), style, np.random.default_rng(seed))


@pytest.mark.parametrize(("kind", "style"), THINGS)
def test_every_style_is_made_on_every_head(fits: dict[str, Fit], kind: str, style: str) -> None:
    for fit in fits.values():
        made = make(fit, kind, style)
        assert np.isfinite(made.vertices).all() and len(made.triangles) <= MOST_TRIANGLES
        assert {material.label for material in made.materials} == {LABELS[kind]}
        assert (
            made.vertex_colors is not None and 0 <= made.vertex_colors.min() <= made.vertex_colors.max() <= 1
        )
        corners = made.vertices[made.triangles]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert (area > 1e-9).mean() > 0.95
        again = make(fit, kind, style)
        assert (again.vertices == made.vertices).all() and (again.triangles == made.triangles).all()
        other = make(fit, kind, style, seed=4)
        assert (
            other.vertex_colors.shape != made.vertex_colors.shape
            or (other.vertex_colors != made.vertex_colors).any()
        )


@pytest.mark.parametrize(("kind", "style"), THINGS)
def test_what_has_no_landmarks_wears_nothing(fits: dict[str, Fit], kind: str, style: str) -> None:
    fit = fits["parametric"]
    with pytest.raises(CannotWear):
        make(replace(fit, points=np.full_like(fit.points, np.nan)), kind, style)


@pytest.mark.parametrize(("source", "style"), [*product(SOURCES, STYLES["glasses"][1:])])
def test_glasses_stand_before_the_eyes_and_touch_nothing(
    fits: dict[str, Fit], source: str, style: str
) -> None:
    fit = fits[source]
    face, made = Face.of(fit), make(fit, "glasses", style)
    panes = of_material(made, "lenses") @ face.rotation
    for side in (-1, 1):
        pane, pupil = panes[np.sign(panes[:, 0]) == side], face.pupil(side)
        centre = (pane.max(axis=0) + pane.min(axis=0)) / 2
        assert abs(centre[0] - pupil[0]) < 8 and abs(centre[1] - pupil[1]) < 8
        assert 10 < centre[2] - face.front(pupil[:1], pupil[1:2])[0] < 36
        assert 36 < np.ptp(pane[:, 0]) < 64 and 26 < np.ptp(pane[:, 1]) < 56
    front = of_material(made, "frame", "lens")
    depth = (front @ face.rotation)[:, 2]
    # Temples run along the head; what is in front of the eyes is free of it.
    assert behind_front_mm(fit, front[depth > panes[:, 2].min() - 4]) < 0.3
    assert depth.min() < 15, "the temples reach the ears"


def test_lenses_are_of_the_kind_that_is_asked_for(fits: dict[str, Fit]) -> None:
    opacities = []
    for lenses in LENSES:
        made = make(fits["parametric"], "glasses", "round", lenses=lenses)
        [pane] = [material for material in made.materials if material.name == "lenses"]
        assert pane.gloss == 0.9
        opacities.append(pane.opacity)
    assert opacities == [0.08, 0.45, 0.85, 0.95]


@pytest.mark.parametrize(("source", "style"), [*product(SOURCES, STYLES["mask"][1:])])
def test_a_mask_covers_mouth_nostrils_and_chin(fits: dict[str, Fit], source: str, style: str) -> None:
    fit = fits[source]
    made = make(fit, "mask", style)
    covered = [0, 13, 14, 17, 61, 291, 1, 2, 4, 5, 98, 327, 152, 199, 175]
    assert covers(made, fit, fit.points[covered]).all()
    bare = [33, 263, 168, 10, 151]
    assert not covers(made, fit, fit.points[bare]).any()
    # Nothing pokes through: wherever one looks at the cloth, it is before the head.
    cloth = of_material(made, f"mask {style}")
    middle = np.array([0.0, fit.points[13, 1], 30.0])
    out = cloth - middle
    length = np.linalg.norm(out, axis=1)
    head = fit.outermost(middle, out / length[:, None])
    assert np.nanmax(head - length) < 0.2


@pytest.mark.parametrize(("source", "style"), [*product(SOURCES, STYLES["headwear"][1:])])
def test_what_is_on_the_head_encloses_it_and_leaves_the_face(
    fits: dict[str, Fit], source: str, style: str
) -> None:
    fit = fits[source]
    made, face = make(fit, "headwear", style), Face.of(fit)
    head = face.vertices
    top, chin = face.at(10)[0, 1], face.at(152)[0, 1]
    if style == "headscarf":  # skull and ears
        kept = (head[:, 1] > chin + 45) & (head[:, 2] < 15)
    elif style == "headband":  # what is behind the band at the height of the front's middle
        band = made.vertices @ face.rotation
        middle = band[band[:, 2] > 60][:, 1].mean()
        kept = (np.abs(head[:, 1] - middle) < 8) & (head[:, 2] > 70)
    else:
        kept = head[:, 1] > top + 12
    assert kept.sum() > 10
    assert covers(made, fit, head[kept] @ face.rotation.T).all()
    assert not covers(made, fit, fit.points[[33, 263, 1, 13, 4, 61, 291]]).any()


@pytest.mark.parametrize("style", ["cap", "beanie", "brimmed", "hard-hat"])
def test_a_hat_leaves_the_lobes_of_the_ears(fits: dict[str, Fit], style: str) -> None:
    fit = fits["facescape"]
    made, face = make(fit, "headwear", style), Face.of(fit)
    ear = face.sides[1].ear
    assert ear.found
    low = face.vertices[
        (face.vertices[:, 0] > 60)
        & (face.vertices[:, 1] < ear.top - 34)
        & (face.vertices[:, 1] > ear.bottom)
        & (face.vertices[:, 2] < ear.front)
        & (face.vertices[:, 2] > ear.back)
    ]
    assert len(low) > 5 and not covers(made, fit, low @ face.rotation.T).any()


@pytest.mark.parametrize(("source", "style"), [*product(SOURCES, ["over-ear", "on-ear"])])
def test_cups_are_at_the_ears_and_the_band_is_over_the_crown(
    fits: dict[str, Fit], source: str, style: str
) -> None:
    fit = fits[source]
    face = Face.of(fit)
    made = make(fit, "headphones", style)
    cushions = of_material(made, "cushions") @ face.rotation
    for side in (-1, 1):
        ear = face.sides[side].ear
        assert ear.found
        cup = cushions[(np.sign(cushions[:, 0]) == side) & (cushions[:, 1] < ear.top + 20)]
        middle = (cup.max(axis=0) + cup.min(axis=0)) / 2
        assert abs(middle[1] - (ear.top + ear.bottom) / 2) < 4
        assert abs(middle[2] - (ear.front + ear.back) / 2) < 4
    crown = face.vertices[face.vertices[:, 1].argmax()]
    band = of_material(made, "headphones") @ face.rotation
    highest = band[:, 1].max()
    assert 2 < highest - crown[1] < 40
    lifted = make(fit, "headphones", style, headwear="cap")
    assert (of_material(lifted, "headphones") @ face.rotation)[:, 1].max() > highest + 10
    with pytest.raises(CannotWear, match="hard-hat"):
        make(fit, "headphones", style, headwear="hard-hat")


@pytest.mark.parametrize(("source", "style"), [*product(SOURCES, STYLES["occluder"][1:])])
def test_what_is_before_the_face_stands_before_the_nose(
    fits: dict[str, Fit], source: str, style: str
) -> None:
    fit = fits[source]
    face = Face.of(fit)
    made = make(fit, "occluder", style)
    things = made.vertices @ face.rotation
    nose = face.at(1, 4)
    assert 15 < things[:, 2].min() - nose[:, 2].max() < 65
    assert covers(made, fit, fit.points[[4]]).all()
    assert 60 < np.ptp(things[:, :2], axis=0).max() < 370, "as large as a hand, or a sheet of paper"


@pytest.mark.parametrize("kind", LABELS)
def test_every_style_is_seen_in_pixels(
    fits: dict[str, Fit], renderer: Renderer, tmp_path: Path, kind: str
) -> None:
    fit = fits["facescape"]
    head = tmp_path / "head.npz"
    save_package(fit.mesh, head)
    views = plan_views(
        load_config(None, {"render": {"resolution": 96}}), "amy/neutral", 150.0, [(25.0, 0.0, 0.0)]
    )
    styles, worn = STYLES[kind][1:], []
    for style in styles:
        thing = tmp_path / f"{kind}-{style}.npz"
        save_package(make(fit, kind, style), thing)
        worn.append((Worn(str(thing)),))
    many = Views(views.poses * (1 + len(styles)), views.cameras, views.looks)
    images = [read_image(path).astype(float) for path in renderer.render(head, many, worn=((), *worn))]
    for style, image in zip(styles, images[1:], strict=True):
        changed = (np.abs(image - images[0]).max(axis=2) > 12).mean()
        assert changed > (0.002 if style in ("rimless", "earbuds") else 0.006), f"{style}: {changed:.4f}"

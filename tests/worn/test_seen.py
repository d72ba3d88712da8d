# SPDX-License-Identifier: GPL-3.0-or-later
"""Every style of everything on heads of three sources: in the pixels, and in its class of segmentation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from where import SOURCES

from generator.dataset.format.passes import passes_from_blender
from generator.execution.lanes.renderer import Renderer
from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.package import save_package
from generator.labels import LABELS
from generator.placing.rendering import read_image
from generator.plan.settings import Look
from generator.plan.views import View, Views
from generator.plan.wear import STYLES
from generator.registries import WORN
from generator.worn.fit import Fit
from generator.worn.wardrobe import Wardrobe

pytestmark = pytest.mark.slow

CAMERA = Camera.square(64, 85.0, 1100.0)

CLASSES = {"headphones": "headwear"}
"""Kinds whose class has another name."""

EVERY = [(kind, style) for kind in WORN if kind in STYLES for style in STYLES[kind][1:]]
FIRST = [(kind, STYLES[kind][1]) for kind in WORN if kind in STYLES]


@pytest.mark.parametrize(("source", "wanted"), [*zip(SOURCES, (EVERY, FIRST, FIRST), strict=True)])
def test_each_is_in_its_class_and_changes_the_picture(
    fits: dict[str, Fit], renderer: Renderer, tmp_path: Path, source: str, wanted: list[tuple[str, str]]
) -> None:
    fit = fits[source]
    save_package(fit.mesh, tmp_path / "head.npz")
    looks = [Look(), *(Look(**{kind: style}) for kind, style in wanted)]
    views = Views.of([View((15.0, 0.0, 0.0), CAMERA, look) for look in looks])
    dressed = Wardrobe(tmp_path / "worn").dress("a/b", fit.mesh, fit.points @ CAMERA_FROM_GRAPHICS, views)
    left_out = {one: why for one, why in zip(wanted, dressed.left_out[1:], strict=True) if why}
    assert len(left_out) < 0.3 * len(wanted), left_out  # such as hair on a head that has long hair of its own
    pictures = [
        read_image(path).astype(int)
        for path in renderer.render(tmp_path / "head.npz", views, worn=dressed.worn)
    ]
    passes = ("segmentation",)
    classes = [
        passes_from_blender(path, passes, CAMERA.distance_mm)
        for path in renderer.render(tmp_path / "head.npz", views, passes=passes, worn=dressed.worn)
    ]
    bare, nothing = pictures[0], classes[0]
    for (kind, style), picture, found in zip(wanted, pictures[1:], classes[1:], strict=True):
        if (kind, style) in left_out:
            continue
        label = CLASSES.get(kind, kind)
        assert label in LABELS
        share = found[f"segmentation.{label}"] - nothing[f"segmentation.{label}"]
        # A pixel of which it covers more than half has another colour than before; few may have the same.
        covered = share > 0.5
        changed = np.abs(picture - bare).max(axis=2) > 2
        assert share.sum() > 1.5, f"{kind} {style} is seen nowhere"
        if covered.sum() > 10:
            assert changed[covered].mean() > 0.8, f"{kind} {style} is in its class and not in the picture"
        assert changed[found["segmentation.background"] == nothing["segmentation.background"]].mean() < 0.9

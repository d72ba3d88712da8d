# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes ``albedo`` and ``segmentation``: shares of pixels against areas, and against our own rays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_passes import box

from generator.dataset.format.passes import passes_from_blender
from generator.errors import WorkerError
from generator.execution.lanes.renderer import Renderer
from generator.geometry.camera import Camera
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.labels import LABELS
from generator.landmarks.surface import Surface
from generator.placing.rendering import read_image
from generator.plan.passes import PAINTED_SAMPLES, SEGMENTATION
from generator.plan.settings import Look
from generator.plan.views import View, Views
from generator.plan.wear import Worn

PAINTED = ("albedo", "segmentation")
CAMERA = Camera.square(48, 85.0, 500.0)


def plate(left: float, right: float, z: float, material: Material) -> HeadMesh:
    """A wide plate between two heights, mm, frame U."""
    corners = np.array([[-200, left, z], [200, left, z], [200, right, z], [-200, right, z]], float)
    index = np.zeros(2, np.int32)
    return HeadMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), None, None, index, (material,))


def painted(renderer: Renderer, folder: Path, mesh: HeadMesh, *views: View, worn=()) -> list[dict]:
    save_package(mesh, folder / "head.npz")
    things = ()
    if worn:
        save_package(worn[0], folder / "worn.npz")
        things = ((Worn(str(folder / "worn.npz")),),) * len(views)
    paths = renderer.render(folder / "head.npz", Views.of(views), passes=PAINTED, worn=things)
    return [passes_from_blender(path, PAINTED, CAMERA.distance_mm) for path in paths]


@pytest.mark.parametrize("look", [Look(), Look(preset="quality", samples=2), Look(ambient=0.1)])
def test_shares_are_areas_whatever_the_light(renderer: Renderer, tmp_path: Path, look: Look) -> None:
    # A pixel at the pivot is 500 / focal mm wide; the plate ends a quarter of a pixel above the middle.
    side = CAMERA.distance_mm / CAMERA.focal_px
    red = Material("red", (1.0, 0.0, 0.0))
    [found] = painted(renderer, tmp_path, plate(-300, 0.25 * side, 0.0, red), View((0, 0, 0), CAMERA, look))
    skin, background = found["segmentation.skin"], found["segmentation.background"]
    assert np.allclose(skin[24:], 1) and np.allclose(skin[:23], 0)
    assert np.allclose(skin[23], 0.25, atol=1.5 / PAINTED_SAMPLES)
    assert np.allclose(skin + background, 1)
    red_light = found["albedo.R"]
    assert np.allclose(red_light[23:], 1) and np.isnan(red_light[:23]).all(), "the light changes no colour"


def test_a_lens_is_as_much_as_it_hides(renderer: Renderer, tmp_path: Path) -> None:
    blue = Material("lens", (0.0, 0.0, 1.0), label="glasses", opacity=0.25)
    lens = plate(-300, 300, 20.0, blue)
    mesh = plate(-300, 300, 0.0, Material("red", (1.0, 0.0, 0.0)))
    [found] = painted(renderer, tmp_path, mesh, View((0, 0, 0), CAMERA, Look()), worn=(lens,))
    assert np.allclose(found["segmentation.glasses"], 0.25) and np.allclose(found["segmentation.skin"], 0.75)
    assert np.allclose(found["albedo.B"], 0.25) and np.allclose(found["albedo.R"], 0.75)


def test_classes_of_materials_are_those_that_rays_meet(renderer: Renderer, tmp_path: Path) -> None:
    """Six classes on the six faces of a cube, turned: each pixel's centre against Embree."""
    labels = ("skin", "hair", "eyes", "teeth", "clothes", "occluder")
    materials = tuple(Material(label, label=label) for label in labels)
    mesh = replace(box(), materials=materials, material_index=np.repeat(np.arange(6, dtype=np.int32), 2))
    views = [View(pose, CAMERA, Look()) for pose in ((30.0, 20.0, 10.0), (-50.0, -35.0, 0.0))]
    surface = Surface(mesh)
    seen = set()
    for view, found in zip(views, painted(renderer, tmp_path, mesh, *views), strict=True):
        centres = np.stack(np.meshgrid(np.arange(48) + 0.5, np.arange(48) + 0.5), axis=-1).reshape(-1, 2)
        origins, directions = CAMERA.rays(centres)
        from generator.geometry.rotation import rotation_from_angles

        turn = rotation_from_angles(np.array(view.pose))
        hits = surface.first_hits((origins - CAMERA.translation_mm) @ turn, directions @ turn)
        classes = np.stack([found[name] for name in SEGMENTATION.channel_names], axis=-1).reshape(-1, 13)
        sure = classes.max(axis=1) == 1
        met = np.where(hits.triangles < 0, -1, hits.triangles // 2)
        expected = np.array([0, *(1 + LABELS.index(label) for label in labels)])[met + 1]
        assert (classes.argmax(axis=1)[sure] == expected[sure]).all() and sure.mean() > 0.7
        seen |= {*expected[sure].tolist()}
    assert len(seen) > 4


def test_a_map_says_it_texel_by_texel(renderer: Renderer, tmp_path: Path) -> None:
    numbers = np.full((8, 8), LABELS.index("skin"), np.uint8)
    numbers[:4] = LABELS.index("hair")  # the upper half of the texture
    Image.fromarray(numbers).save(tmp_path / "labels.png")
    whole = Material("skin", label_map=tmp_path / "labels.png")
    mesh = replace(box(), materials=(whole,))
    [found] = painted(renderer, tmp_path, mesh, View((0.0, 0.0, 0.0), CAMERA, Look()))
    skin, hair = found["segmentation.skin"], found["segmentation.hair"]
    assert skin[28, 24] == 1 and hair[20, 24] == 1 and np.isclose(skin.sum(), hair.sum(), rtol=0.02)


def test_a_picture_that_is_missing_is_noticed(renderer: Renderer, tmp_path: Path) -> None:
    mesh = replace(box(), materials=(Material("a"), Material("b", label="occluder")))
    mesh = replace(mesh, material_index=np.repeat(np.int32([0, 1]), 6))
    save_package(mesh, tmp_path / "head.npz")
    views = Views.of([View((30.0, 0.0, 0.0), CAMERA, Look())])
    [path] = renderer.render(tmp_path / "head.npz", views, passes=PAINTED)
    path.with_name(f"{path.stem}.segmentation3.exr").unlink()
    with pytest.raises(WorkerError, match="a class of the segmentation is missing"):
        passes_from_blender(path, PAINTED, 500.0)


def test_layers_of_the_head_itself_are_left_to_no_chance(renderer: Renderer, tmp_path: Path) -> None:
    veils = [("skin", 40.0, 0.3), ("eyes", 20.0, 0.5), ("hair", 0.0, 0.4), ("clothes", -40.0, 1.0)]
    plates = [plate(-300, 300, z, Material(label, label=label, opacity=share)) for label, z, share in veils]
    whole = replace(
        plates[0],
        vertices=np.concatenate([one.vertices for one in plates]),
        triangles=np.concatenate([one.triangles + 4 * k for k, one in enumerate(plates)]),
        material_index=np.repeat(np.arange(len(plates), dtype=np.int32), 2),
        materials=tuple(one.materials[0] for one in plates),
    )
    [found] = painted(renderer, tmp_path, whole, View((0, 0, 0), CAMERA, Look()))
    left = 1.0
    for label, _, share in veils:
        assert np.allclose(found[f"segmentation.{label}"], left * share, atol=1e-3), label
        left *= 1 - share


def test_a_picture_of_as_many_samples_is_no_picture_of_classes(renderer: Renderer, tmp_path: Path) -> None:
    """It may be taken on the stage on which passes were painted."""
    view = View((30.0, 0.0, 0.0), CAMERA, Look(samples=PAINTED_SAMPLES))
    save_package(box(), tmp_path / "head.npz")

    def picture() -> np.ndarray:
        return read_image(next(iter([*renderer.render(tmp_path / "head.npz", Views.of([view]))])))

    before = picture()
    [path] = renderer.render(tmp_path / "head.npz", Views.of([view]), passes=PAINTED)
    passes_from_blender(path, PAINTED, CAMERA.distance_mm)
    assert np.array_equal(picture(), before)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Every image its own pose, camera and look: where things are seen, and the same bytes as alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_render import CAMERA, FLAT, MARKS, centroid, marked_ball

from generator.dataset.format.passes import passes_from_blender
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.picture.scenery import Folders
from generator.placing.rendering import read_image
from generator.plan.settings import Look
from generator.plan.views import View, Views

__all__ = ["marked_ball"]  # the fixture

CAMERAS = (
    CAMERA,
    Camera.square(96, 50.0, 420.0),
    Camera(160, 96, 85.0, 900.0),
    Camera(96, 160, 60.0, 700.0),
    Camera(128, 128, 85.0, 700.0, principal_px=(50.0, 81.5)),
    Camera(160, 120, 85.0, 800.0, "orthographic", (70.0, 66.0)),
    Camera.square(128, 300.0, 2500.0),
)
LOOKS = (
    FLAT,
    replace(FLAT, background=(0.1, 0.2, 0.3)),
    replace(FLAT, samples=2),
    Look(light_yaw_deg=-60.0, light_pitch_deg=10.0, ambient=0.2),
    replace(FLAT, preset="quality", samples=2),
)


def mixed(count: int = 14) -> Views:
    """Views that share nothing but chance; the preset stays for some in a row, as in a plan of one preset."""
    rng = np.random.default_rng(7)
    poses = rng.uniform([-40, -30, -30], [40, 30, 30], (count, 3)).round(3)
    return Views.of(
        [
            View(tuple(pose), CAMERAS[k % len(CAMERAS)], LOOKS[(k // 3) % len(LOOKS)])
            for k, pose in enumerate(poses.tolist())
        ]
    )


@pytest.fixture(scope="module")
def package(marked_ball: HeadMesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The ball as a render worker reads it."""
    path = tmp_path_factory.mktemp("views") / "ball.npz"
    save_package(marked_ball, path)
    return path


def test_every_mark_is_where_its_own_row_says(renderer: Renderer, package: Path) -> None:
    """Lens, distance, principal point, projection and shape of the image, all different from view to view."""
    views = mixed(28)
    checked = 0
    for view, image in zip(views, Shots(renderer).take(package, views, Folders()), strict=True):
        assert image.shape == (view.camera.height, view.camera.width, 3)
        if replace(view.look, samples=FLAT.samples) != FLAT:
            continue  # its colours say nothing of the marks
        for channel, (centre, _) in enumerate(MARKS.values()):
            turned = rotation_from_angles(np.array(view.pose)) @ (
                CAMERA_FROM_GRAPHICS @ np.array(centre, float)
            )
            seen = centroid(image, channel)
            if turned[2] > -15 or seen is None:
                continue  # partly behind the ball
            checked += 1
            expected = view.camera.project(turned + view.camera.translation_mm)
            assert np.abs(seen - expected).max() < 0.35, view
    assert checked >= 12


def test_an_image_is_the_same_whatever_was_rendered_before_it(renderer: Renderer, package: Path) -> None:
    """Cropping, backdrops and what a stage keeps from view to view change no byte."""
    views = mixed()
    shots = Shots(renderer)
    together = [image.tobytes() for image in shots.take(package, views, Folders())]
    backwards = [image.tobytes() for image in shots.take(package, Views.of([*views][::-1]), Folders())]
    assert together == backwards[::-1]
    for view, image in zip(views, together, strict=True):
        [alone] = shots.take(package, Views.of([view]), Folders())
        assert alone.tobytes() == image
    assert len(set(together)) == len(together)


def test_an_image_is_the_same_whatever_head_was_there_before(
    renderer: Renderer, package: Path, marked_ball: HeadMesh, tmp_path: Path
) -> None:
    """What a worker keeps from head to head changes no byte."""
    other, views = (
        tmp_path / "other.npz",
        Views.of([View((5.0 * k, 0.0, 0.0), CAMERA, FLAT) for k in range(3)]),
    )
    save_package(replace(marked_ball, vertices=marked_ball.vertices * [0.5, 1.2, 0.8]), other)
    alone = []
    for path in (package, other):
        worker = Renderer(tmp_path, tmp_path / "render.log")
        alone.append([image.read_bytes() for image in worker.render(path, views)])
        worker.close()
    assert alone[0] != alone[1]
    for path, images in ((package, alone[0]), (other, alone[1]), (package, alone[0])):
        assert [image.read_bytes() for image in renderer.render(path, views)] == images


def test_backgrounds_follow_their_rows(renderer: Renderer, package: Path) -> None:
    colors = [(0.2, 0.4, 0.8), (0.9, 0.1, 0.3), (0.2, 0.4, 0.8)]
    views = Views(((0.0, 0.0, 0.0),) * 3, (CAMERA,), tuple(replace(FLAT, background=c) for c in colors))
    for color, path in zip(colors, renderer.render(package, views), strict=True):
        assert np.abs(read_image(path)[1, 1] - np.round(np.array(color) * 255)).max() <= 1


def test_passes_belong_to_their_own_camera(renderer: Renderer, package: Path) -> None:
    views = mixed(7)
    for view, path in zip(views, renderer.render(package, views, passes=("position",)), strict=True):
        camera = view.camera
        channels = passes_from_blender(path, ("position",), camera.distance_mm)
        position = np.stack([channels[f"position.{axis}"] for axis in "XYZ"], axis=-1) * 1e3
        assert position.shape[:2] == (camera.height, camera.width)
        centres = np.stack(
            np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5), axis=-1
        )
        there = np.isfinite(position).all(axis=-1)
        assert there.sum() > 200
        off = np.abs(camera.project(position[there]) - centres[there]).max(axis=1)
        assert np.quantile(off, 0.999) < 0.01

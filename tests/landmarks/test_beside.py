# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair turns with the head and hides; the rest of a scene stands still before its camera and hides."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.scene_camera import SceneCamera
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import load_package, save_package
from generator.heads.placement import Placement
from generator.heads.scene import BlendScene
from generator.landmarks.beside import Beside
from generator.plan.settings import Look
from generator.plan.views import Views

PLACEMENT = Placement("m", 1000.0, "+Y", "+Z", (0.0, 0.0, 0.0), 100.0, 90.0)
NOSE = np.array([[0.0, 0.0, -100.0]])
"""Frame C, mm."""

QUARTER = np.array([[0, 0, 1, 5], [1, 0, 0, 6], [0, 1, 0, 7], [0, 0, 0, 2.0]]) / 2
"""The head's own axes in the world: turned, half as large, away."""


def square(middle: tuple[float, float, float], file: Path) -> str:
    """A square of 2 cm, facing the camera at pose zero, as a package in metres."""
    side = 0.01
    corners = np.array([(x, y, 0) for x in (-side, side) for y in (-side, side)]) + middle
    triangles = np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32)
    save_package(HeadMesh(corners, triangles, None, None, np.zeros(2, np.int32), (Material("a"),)), file)
    return str(file)


def scene_of(**files: str) -> BlendScene:
    world = QUARTER.copy()
    world[3] = 0, 0, 0, 1
    own = BlendScene("a.blend", "Head", "", tuple(world.reshape(-1).tolist()), **files)
    return own.moved(np.eye(3), np.zeros(3), 1000.0)


def hidden(scene: BlendScene, camera: Camera) -> list[bool]:
    views = Views(((0, 0, 0), (30, 0, 0)), (camera,), (Look(),))
    return Beside(scene, PLACEMENT).hides(NOSE, views)[:, 0].tolist()


def test_hair_turns_with_the_head_and_the_rest_does_not(tmp_path: Path) -> None:
    before = square((0.0, 0.0, 0.15), tmp_path / "before.npz")
    camera = Camera.square(100, 85.0, 1000.0)
    assert hidden(scene_of(), camera) == [False, False]
    assert hidden(scene_of(hair=before), camera) == [True, False]
    assert hidden(scene_of(rest=before), camera) == [True, False]
    # At yaw 30 the nose is 50 mm to image left, and there something stands; hair there has turned away.
    aside = square((-0.05, 0.0, 0.2), tmp_path / "aside.npz")
    assert hidden(scene_of(rest=aside), camera) == [False, True]
    assert hidden(scene_of(hair=aside), camera) == [False, False]


def test_the_rest_stands_before_the_scene_s_own_camera(tmp_path: Path) -> None:
    """The camera of the scene stands at the head's left ear and looks at its right one."""
    scene = scene_of(rest=square((0.0, 0.0, 0.15), tmp_path / "before.npz"))
    rotation = scene.rotation @ np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]])
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = rotation, scene.world(np.array([1000.0, 0.0, 0.0]))
    scene = replace(scene, camera_world=tuple(world.reshape(-1).tolist()))
    scene = replace(scene, camera=SceneCamera(85.0, 36.0, 24.0, 0, 0.0, 0.0, 1.0, 100, 100))
    own = scene.seen_pivot(np.zeros(3), 1.0)
    assert own is not None
    assert np.allclose(own.at(100).translation_mm, (0, 0, 1000))
    # The pivot's front is image left there: what stands before the face at pose zero hides nothing of it.
    assert hidden(scene, own.at(100)) == [False, False]
    assert load_package(Path(scene.rest)).scene is None

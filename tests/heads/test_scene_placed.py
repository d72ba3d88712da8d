# SPDX-License-Identifier: GPL-3.0-or-later
"""A head in a scene: what of the scene's camera can be used, and what hides landmarks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generator.geometry.camera import Camera
from generator.geometry.scene_camera import SceneCamera
from generator.heads.head import SCENE as SCENE_SOURCE
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh, Material
from generator.heads.placement import Placement
from generator.heads.scene import BlendScene
from generator.heads.surroundings import head_alone
from generator.landmarks.surface import Surface
from generator.placing import face

TO_WORLD = tuple(np.eye(4).reshape(-1).tolist())
CAMERA = SceneCamera(50.0, 36.0, 24.0, 0, 0.0, 0.0, 1.0, 64, 64)
EYE = np.eye(4)
EYE[2, 3] = 1.5
SCENE = BlendScene(
    "a.blend", "Head", "", TO_WORLD, CAMERA, tuple(EYE.reshape(-1).tolist()), clip=(0.1, 100.0)
)
"""Its camera stands 1.5 m before the origin of a mesh in metres."""


def test_a_camera_that_cuts_the_head_off_is_refused() -> None:
    def why(*clip: float) -> str:
        return replace(SCENE, clip=clip).why_no_camera(np.zeros(3), 1000.0, 150.0)

    assert why(0.1, 100.0) == why(1.34, 1.66) == ""
    assert why(1.4, 100.0) == (
        "the scene's camera shows what is 1400 to 100000 mm before it (clip start and end), and the head is "
        "1350 to 1650 mm before it"
    )
    assert "1600 mm" in why(0.1, 1.6)
    none = replace(SCENE, camera=None, no_camera="the scene has no camera")
    assert none.why_no_camera(np.zeros(3), 1000.0, 150.0) == "the scene has no camera"


def test_what_is_nearer_than_the_clip_start_hides_nothing() -> None:
    pane = np.array([(-300.0, -300.0, 900.0), (300.0, -300.0, 900.0), (0.0, 600.0, 900.0)])
    surface = Surface(_mesh(pane, np.array([[0, 1, 2]])))
    camera = replace(CAMERA, pivot_z=1500.0).at(64)
    point, still = np.zeros((1, 3)), np.eye(3)[None]
    assert surface.hides(point, still, [camera]).tolist() == [[True]]
    assert surface.hides(point, still, [camera], from_mm=590.0).tolist() == [[True]]
    assert surface.hides(point, still, [camera], from_mm=610.0).tolist() == [[False]]
    millimetres = replace(SCENE, to_world=tuple(np.diag([1e-3, 1e-3, 1e-3, 1]).reshape(-1).tolist()))
    assert millimetres.nearest_mm(camera) == 100.0
    assert millimetres.nearest_mm(Camera.square(64, 50.0, 1500.0)) == 0.0


def test_what_lies_apart_from_the_head_is_rendered_in_a_scene_and_hides() -> None:
    points = np.random.default_rng(1).normal(size=(30, 3))
    points *= 100 / np.linalg.norm(points, axis=1, keepdims=True)
    strip = np.array([[k, k + 1, k + 2] for k in range(28)])
    away = np.array([(0.0, 0.0, 700.0), (50.0, 0.0, 700.0), (0.0, 50.0, 700.0)])
    mesh = _mesh(np.concatenate([points, away]), np.concatenate([strip, [[30, 31, 32]]]))
    placement = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 100.0, 60.0)
    assert len(head_alone(mesh, placement).triangles) == 28
    assert head_alone(replace(mesh, scene=SCENE), placement).triangles.tolist() == mesh.triangles.tolist()


def test_a_head_of_an_imported_file_has_the_axes_of_that(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[tuple[str, str]] = []

    def straight(*given: Any) -> str | None:
        tried.append(given[3])
        return "placed" if given[3] == ("+Y", "+Z") else None

    monkeypatch.setattr(face, "_straight", straight)
    monkeypatch.setattr(face, "find_around", lambda *_: [])
    mesh = _mesh(np.eye(3), np.array([[0, 1, 2]]))
    file = Path("a.blend")
    assert face.find_face(Head("a", "neutral", SCENE_SOURCE, file, (file,)), mesh, None) == "placed"  # type: ignore[arg-type, comparison-overlap]
    assert tried == [("+Z", "-Y"), ("+Y", "+Z")]


def _mesh(vertices: np.ndarray, triangles: np.ndarray) -> HeadMesh:
    return HeadMesh(vertices, triangles, None, None, np.zeros(len(triangles), np.int32), (Material("skin"),))

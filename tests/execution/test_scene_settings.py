# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be asked of heads in scenes, and the camera that a row of one has."""

from __future__ import annotations

import math
from typing import Any

import pytest

from generator.errors import UsageError
from generator.execution.build.units import head_camera
from generator.geometry.scene_camera import SceneCamera
from generator.heads.placement import Placement
from generator.plan.config import load_config
from generator.plan.render_settings import Look
from generator.plan.scenes import check_of_scenes, seen_look

OWN = SceneCamera(70.0, 30.0, 20.0, 2, 0.1, -0.07, 1.25, 640, 480, 20.0, -30.0, 1500.0)


def placed(**known: Any) -> Placement:
    return Placement("m", 1000.0, "+Z", "-Y", (0.0, 0.0, 0.0), 120.0, 90.0, **known)


def test_the_camera_of_a_row_is_the_scene_s() -> None:
    config = load_config(None, {"render": {"scene_camera": True, "resolution": 96}})
    camera = head_camera(config, placed(scene_camera=OWN))
    assert (camera.width, camera.height) == (96, 72)
    assert camera.translation_mm.tolist() == [20.0, -30.0, 1500.0]
    across, down = camera.matrix[0, 0], camera.matrix[1, 1]
    assert across == pytest.approx(70 / 20 * 72 * 1.25) and across / down == pytest.approx(1.25)
    ours = head_camera(load_config(None, {}), placed(scene_camera=OWN))
    assert ours.translation_mm[:2].tolist() == [0.0, 0.0] and not ours.of_scene


def test_a_camera_that_cannot_be_used_is_refused_with_its_reason() -> None:
    config = load_config(None, {"render": {"scene_camera": True}})
    with pytest.raises(UsageError, match=r"^--scene-camera: the scene's camera is ortho; correct that in Bl"):
        head_camera(config, placed(no_camera="the scene's camera is ortho"))
    with pytest.raises(UsageError, match=r"^--scene-camera: the heads are in no Blender scene; remove it$"):
        check_of_scenes(config, scenes=False)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"render": {"ambient": 0.5}}, "--ambient: a scene is rendered with its own light"),
        ({"render": {"light_yaw_deg": "uniform:0,9"}}, "--light: a scene is rendered with its own light"),
        ({"render": {"variety": "photo"}}, "a scene is rendered with its own light"),
        (
            {"render": {"scene_camera": True, "margin": 2}},
            "--margin: a scene is rendered with its own cam",
        ),
        ({"dataset": {"twins": ["light"]}}, "--twins light: a scene is rendered as it stands"),
        (
            {"dataset": {"passes": ["segmentation"]}},
            "--passes segmentation: the materials of a scene do not tell it",
        ),
    ],
)
def test_what_a_scene_decides_is_refused_in_a_line(values: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        check_of_scenes(load_config(None, values), scenes=True)
    if "scene_camera" not in values.get("render", {}):
        check_of_scenes(load_config(None, values), scenes=False)


@pytest.mark.parametrize(
    "values",
    [
        {"render": {"resolution": 64, "lens_mm": 50, "exposure_ev": "normal:0,1", "preset": "quality"}},
        {"render": {"scene_camera": True, "samples": 8}, "dataset": {"passes": ["depth", "position"]}},
        {"dataset": {"twins": ["exposure", "lens"]}},
    ],
)
def test_what_a_camera_does_is_not(values: dict[str, Any]) -> None:
    check_of_scenes(load_config(None, values), scenes=True)


def test_rows_do_not_say_what_the_scene_decided() -> None:
    seen = seen_look(Look(exposure_ev=1.0))
    assert math.isnan(seen.light_yaw_deg) and all(map(math.isnan, seen.background))
    assert (seen.hair, seen.environment, seen.exposure_ev) == ("", "", 1.0)

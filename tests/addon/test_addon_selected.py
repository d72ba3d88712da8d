# SPDX-License-Identifier: GPL-3.0-or-later
"""Use Selected: the head in the user's own scene."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from blender_addon.core.turning import Turning
from generator.geometry.rotation import rotation_from_angles
from generator.geometry.scene_camera import SceneCamera
from generator.heads.scene import BlendScene


def scene_of(camera: bool) -> BlendScene:
    world = np.array([[0, 0, 1, 5], [1, 0, 0, 6], [0, 1, 0, 7], [0, 0, 0, 1.0]])
    world[:3, :3] *= 1e-3
    own = np.eye(4)
    own[:3, 3] = 1, 2, 3
    numbers = tuple(own.reshape(-1).tolist())
    lens = SceneCamera(50.0, 36.0, 24.0, 0, 0.0, 0.0, 1.0, 100, 100) if camera else None
    why = "" if camera else "the scene has no camera"
    return BlendScene("a.blend", "Head", "", tuple(world.reshape(-1).tolist()), lens, numbers, why)


@pytest.mark.parametrize("own_camera", [False, True])
def test_it_turns_as_a_build_does(own_camera: bool) -> None:
    """A camera of that rotation sees R_C."""
    turning = Turning.of(scene_of(camera=True), scene_camera=own_camera)
    turning = Turning.of_numbers(turning.numbers)
    pose = (30.0, -20.0, 10.0)
    world = turning.at(pose)
    assert np.allclose(world[:3, 3], (5, 6, 7))
    flip = np.diag([1.0, -1.0, -1.0])
    seen = flip @ turning.camera.T @ world[:3, :3] @ turning.head @ flip
    assert np.allclose(seen, rotation_from_angles(np.array(pose)))
    assert np.allclose(turning.camera, np.eye(3) if own_camera else turning.head)


def test_a_camera_that_cannot_be_used_is_said() -> None:
    with pytest.raises(ValueError, match="the scene has no camera"):
        Turning.of(scene_of(camera=False), scene_camera=True)


def test_it_turns_in_the_users_scene_and_leaves_it_as_it_was(extension_zip: Path, tmp_path: Path) -> None:
    (tmp_path / "profile").mkdir()
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("selected_session.py")), extension_zip, tmp_path],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "profile"), "PYTHONSAFEPATH": ""},
    )
    assert "passed" in done.stdout and done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr, done.stderr

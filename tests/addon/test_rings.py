# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning by hand: axes and ways of the mouse against SciPy's rotations and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from blender_addon.core.rings import axis, facing, rest, swept
from blender_addon.core.units import angle_options, degrees, radians
from generator.geometry.rotation import blender_rotation, rotation_from_angles
from generator.plan.poses import ANGLES

POSES = [(0, 0, 0), (50, 40, 30), (-35, 12.5, -7), (80, -100, 170), (0, 90, 0)]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("angle", ANGLES)
def test_an_angle_that_grows_turns_the_head_about_its_axis(angle: str, pose: tuple[float, ...]) -> None:
    by = 7.5
    after = [value + by * (name == angle) for name, value in zip(ANGLES, pose, strict=True)]
    turned = Rotation.from_rotvec(by * axis(angle, pose), degrees=True).as_matrix()
    before = blender_rotation(rotation_from_angles(np.array(pose)))
    assert np.abs(turned @ before - blender_rotation(rotation_from_angles(np.array(after)))).max() < 1e-12


@pytest.mark.parametrize("by", [-100.0, -3.0, 0.5, 100.0])
@pytest.mark.parametrize("towards", [1, -1])
def test_a_ring_that_faces_the_viewer_turns_as_the_mouse_does(by: float, towards: int) -> None:
    middle, radius, about = np.array([300.0, 200.0]), 120.0, np.array([0.0, 0.0, towards])
    point = np.array([radius * math.cos(2.0), radius * math.sin(2.0), 0.0])
    after = Rotation.from_rotvec(by * about, degrees=True).apply(point)
    assert swept(about, middle, middle + point[:2], middle + after[:2], radius) == pytest.approx(by)


@pytest.mark.parametrize("about", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0.6, 0.8, 0), (0.6, 0.7, 0.15**0.5)])
def test_a_ring_seen_from_its_side_goes_with_the_mouse(about: tuple[float, ...]) -> None:
    """The point in front, by the first order of its way."""
    along, by, radius = np.array(about, dtype=float), 0.01, 250.0
    front = np.array([0, 0, 1.0]) - along[2] * along
    point = radius * front / np.linalg.norm(front)
    moved = Rotation.from_rotvec(by * along, degrees=True).apply(point)
    start = np.array([400.0, 300.0]) + point[:2]
    end = start + moved[:2] - point[:2]
    assert swept(along, (400, 300), start, end, radius) == pytest.approx(by, rel=1e-3)
    assert swept(along, (400, 300), end, start, radius) == pytest.approx(-by, rel=1e-3)


def test_yaw_of_a_head_seen_by_the_camera_follows_the_nose() -> None:
    """Yaw above zero takes the nose to image left, pitch takes it up, roll the crown to image right."""
    view = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # the camera looks along +y of the world, z is up
    middle, front = (0.0, 0.0), (0.0, 0.0)
    seen = {angle: view @ axis(angle, (0, 0, 0)) for angle in ANGLES}
    assert swept(seen["yaw"], middle, front, (-10, 0), 100) == pytest.approx(math.degrees(0.1))
    assert swept(seen["pitch"], middle, front, (0, 10), 100) == pytest.approx(math.degrees(0.1))
    assert swept(seen["roll"], middle, (0, 100), (100, 0), 100) == pytest.approx(90)
    assert facing((0, 0, 0), view) == facing((40, 20, 30), view) == "roll"
    above = np.eye(3)
    assert facing((0, 0, 0), above) == "yaw"
    assert facing((0, 0, 0), np.array([[0, 1.0, 0], [0, 0, 1], [1, 0, 0]])) == "pitch"


def test_a_turn_rests_at_whole_degrees_within_the_limits() -> None:
    assert rest("yaw", 20.3, 11.9, 1) == 32 and rest("yaw", 20.3, 11.9, 0.1) == 32.2
    assert rest("pitch", -2.0, -9.0, 5) == -10 and str(rest("roll", 0.0, 0.3, 0.1)) == "0.3"
    assert rest("yaw", 80, 40, 1) == 89.9 and rest("roll", -170, -40, 1) == -180


def test_angles_are_shown_in_radians_and_keep_their_digits() -> None:
    def held(value: float) -> float:
        return float(np.float32(value))

    for told in (20.0, -12.5, 0.1, 89.9, 179.9999, -33.3333):
        assert degrees(held(radians(told)), 0.0) == told
    third = held(-100 / 3)
    assert degrees((held(radians(third)), held(radians(20.0))), (third, 10.0)) == (third, 20.0)
    assert degrees(held(radians(third)), third) == third
    assert radians((180.0, 0.0)) == (math.pi, 0.0)
    shown = angle_options({"name": "Yaw", "min": -90, "max": 90, "default": 4, "size": 3})
    ends = {"min": -math.pi / 2, "max": math.pi / 2}
    assert shown == {"name": "Yaw", **ends, "size": 3, "precision": 4, "unit": "ROTATION"}
    assert angle_options({"name": "Roll", "precision": 1})["subtype"] == "ANGLE"

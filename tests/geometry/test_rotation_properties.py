# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds of every rotation, whatever its angles."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from generator.geometry import rotation as rot

PITCH_OR_ROLL = st.floats(-180, 180, exclude_min=True)
ANGLES = st.tuples(st.floats(-89.9, 89.9), PITCH_OR_ROLL, PITCH_OR_ROLL).map(np.array)
"""Every pose that has a value of its own: at a yaw of 90 degrees pitch and roll are one."""

WHOLE = st.sampled_from([-89.9, -45.0, 0.0, 45.0, 89.9]), *[st.sampled_from([-90.0, 0.0, 90.0, 180.0])] * 2
ANY = ANGLES | st.tuples(*WHOLE).map(np.array)
"""And often those where a sign or a branch could go wrong."""

VECTORS = st.tuples(*[st.floats(-1e3, 1e3)] * 3).map(np.array)
SAME = 1e-12


def off(a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference."""
    return float(np.abs(a - b).max())


def turn(difference: np.ndarray) -> np.ndarray:
    """An angle without its whole turns, degrees."""
    return (difference + 180.0) % 360.0 - 180.0


@given(ANY)
def test_it_is_a_rotation(angles: np.ndarray) -> None:
    for matrix in (
        rot.rotation_from_angles(angles),
        rot.graphics_rotation(rot.rotation_from_angles(angles)),
        rot.blender_rotation(rot.rotation_from_angles(angles)),
    ):
        assert off(matrix @ matrix.T, np.eye(3)) < SAME
        assert abs(np.linalg.det(matrix) - 1) < SAME


@given(ANY)
def test_angles_come_back(angles: np.ndarray) -> None:
    again = rot.angles_from_rotation(rot.rotation_from_angles(angles))
    assert off(turn(again - angles), np.zeros(3)) < 1e-9
    assert abs(again[0]) <= 90 and (np.abs(again[1:]) <= 180).all()


@given(ANY)
def test_quaternions_come_back_and_have_one_sign(angles: np.ndarray) -> None:
    matrix = rot.rotation_from_angles(angles)
    quaternion = rot.quaternion_from_rotation(matrix)
    assert abs(np.linalg.norm(quaternion) - 1) < SAME and quaternion[0] >= 0
    assert off(rot.rotation_from_quaternion(quaternion), matrix) < SAME
    assert off(rot.rotation_from_quaternion(-quaternion), matrix) < SAME, "either sign is the same rotation"


@given(st.permutations([1.0, 0.6, -0.5, 0.3]), st.floats(-0.2, 0.2))
def test_whichever_component_of_a_quaternion_is_the_largest(parts: list[float], more: float) -> None:
    quaternion = np.array(parts) + more
    quaternion /= np.linalg.norm(quaternion)
    again = rot.quaternion_from_rotation(rot.rotation_from_quaternion(quaternion))
    assert off(again, quaternion * np.sign(quaternion[0])) < SAME


@given(ANY, ANY)
def test_frames_agree_about_one_turn_after_another(first: np.ndarray, second: np.ndarray) -> None:
    a, b = rot.rotation_from_angles(first), rot.rotation_from_angles(second)
    for seen in (rot.graphics_rotation, rot.blender_rotation):
        assert off(seen(a) @ seen(b), seen(a @ b)) < SAME
    assert off(rot.graphics_rotation(rot.graphics_rotation(a)), a) < SAME, "there and back"


@given(ANY, VECTORS)
def test_a_point_turns_the_same_way_in_every_frame(angles: np.ndarray, point: np.ndarray) -> None:
    matrix = rot.rotation_from_angles(angles)
    graphics = rot.CAMERA_FROM_GRAPHICS @ point
    turned = rot.graphics_rotation(matrix) @ graphics
    assert off(rot.CAMERA_FROM_GRAPHICS @ turned, matrix @ point) < 1e-9
    blender = rot.blender_rotation(matrix) @ (rot.BLENDER_FROM_GRAPHICS @ graphics)
    assert off(rot.BLENDER_FROM_GRAPHICS.T @ blender, turned) < 1e-9


@given(ANY, ANY, ANY)
def test_the_distance_of_two_poses(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> None:
    a, b, c = map(rot.rotation_from_angles, (first, second, third))
    apart = rot.geodesic_deg(a, b)
    assert rot.geodesic_deg(a, a) < 1e-6
    assert 0 <= apart <= 180
    assert abs(apart - rot.geodesic_deg(b, a)) < 1e-9
    assert abs(apart - rot.geodesic_deg(c @ a, c @ b)) < 1e-6, "wherever one looks from"
    assert apart <= rot.geodesic_deg(a, c) + rot.geodesic_deg(c, b) + 1e-6
    assert abs(apart - rot.geodesic_deg(np.eye(3), a.T @ b)) < 1e-9


@given(st.floats(0, 180), st.integers(0, 2))
def test_the_distance_of_a_turn_about_one_axis_is_its_angle(angle: float, axis: int) -> None:
    angles = np.zeros(3)
    angles[axis] = min(angle, 89.9) if axis == 0 else angle
    assert abs(rot.geodesic_deg(np.eye(3), rot.rotation_from_angles(angles)) - angles[axis]) < 1e-9


@given(st.lists(ANY, min_size=1, max_size=5))
def test_many_at_once_are_each_alone(poses: list[np.ndarray]) -> None:
    angles = np.array(poses)
    matrices = rot.rotation_from_angles(angles)
    assert np.array_equal(matrices, [rot.rotation_from_angles(pose) for pose in poses])
    quaternions = rot.quaternion_from_rotation(matrices)
    assert np.array_equal(quaternions, [rot.quaternion_from_rotation(matrix) for matrix in matrices])
    assert np.array_equal(
        rot.angles_from_rotation(matrices), [rot.angles_from_rotation(matrix) for matrix in matrices]
    )

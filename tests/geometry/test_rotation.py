# SPDX-License-Identifier: GPL-3.0-or-later
"""Every row of docs/conventions.md, against its test vectors and against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generator.geometry import rotation as rot

A = (50.0, 40.0, 30.0)
B = (-35.0, 12.5, -7.0)
R_C_A = """
0.556670399 -0.321393805 0.766044443
-0.043412044 0.909615886 0.413175911
-0.829598373 -0.263258355 0.492403877
"""
R_U_A = """
0.556670399 0.321393805 -0.766044443
0.043412044 0.909615886 0.413175911
0.829598373 -0.263258355 0.492403877
"""
R_B_A = """
0.556670399 0.766044443 0.321393805
-0.829598373 0.492403877 0.263258355
0.043412044 -0.413175911 0.909615886
"""
R_C_B = """
0.813046209 0.099829522 -0.573576436
0.004238754 0.984148273 0.177296952
0.582183729 -0.146581864 0.799734870
"""
Q_A = "0.860042174 -0.196628226 0.463826910 0.080804689"
Q_B = "0.948278618 -0.085385985 -0.304699522 -0.025201129"


def numbers(text: str, *shape: int) -> np.ndarray:
    return np.array(text.split(), dtype=float).reshape(shape)


@pytest.fixture(scope="module")
def random_poses() -> np.ndarray:
    return np.random.default_rng(0).uniform([-89.9, -180, -180], [89.9, 180, 180], (10_000, 3))


@pytest.mark.parametrize(("pose", "matrix", "quaternion"), [(A, R_C_A, Q_A), (B, R_C_B, Q_B)])
def test_published_vectors(pose: tuple, matrix: str, quaternion: str) -> None:
    made = rot.rotation_from_angles(np.array(pose))
    assert np.abs(made - numbers(matrix, 3, 3)).max() < 1e-9
    assert np.abs(rot.quaternion_from_rotation(made) - numbers(quaternion, 4)).max() < 1e-9


def test_graphics_and_blender_matrices() -> None:
    made = rot.rotation_from_angles(np.array(A))
    assert np.abs(rot.graphics_rotation(made) - numbers(R_U_A, 3, 3)).max() < 1e-9
    assert np.abs(rot.blender_rotation(made) - numbers(R_B_A, 3, 3)).max() < 1e-9


def test_signs() -> None:
    nose, crown = np.array([0, 0, -1.0]), np.array([0, -1.0, 0])
    assert (rot.rotation_from_angles(np.array([30, 0, 0])) @ nose)[0] < 0, "yaw > 0: nose to image left"
    assert (rot.rotation_from_angles(np.array([0, 30, 0])) @ nose)[1] < 0, "pitch > 0: nose up"
    assert (rot.rotation_from_angles(np.array([0, 0, 30])) @ crown)[0] > 0, "roll > 0: crown to image right"


def test_scipy_reads_the_same_angles(random_poses: np.ndarray) -> None:
    yaw, pitch, roll = random_poses.T
    made = rot.rotation_from_angles(random_poses)
    theirs = Rotation.from_euler("XYZ", np.stack([-pitch, yaw, roll], 1), degrees=True).as_matrix()
    assert np.abs(made - theirs).max() < 1e-14
    graphics = Rotation.from_matrix(rot.graphics_rotation(made)).as_euler("XYZ", degrees=True)
    assert np.abs(graphics - np.stack([-pitch, -yaw, -roll], 1)).max() < 1e-9


def test_inverse(random_poses: np.ndarray) -> None:
    again = rot.angles_from_rotation(rot.rotation_from_angles(random_poses))
    assert np.abs(again - random_poses).max() < 1e-9


def test_quaternion_against_scipy_and_back(random_poses: np.ndarray) -> None:
    made = rot.rotation_from_angles(random_poses)
    ours = rot.quaternion_from_rotation(made)
    theirs = Rotation.from_matrix(made).as_quat()[:, [3, 0, 1, 2]]
    theirs *= np.where(theirs[:, :1] < 0, -1, 1)
    assert np.abs(ours - theirs).max() < 1e-12
    assert (ours[:, 0] >= 0).all()
    assert np.abs(rot.rotation_from_quaternion(ours) - made).max() < 1e-12


def test_other_codebases_matrices() -> None:
    """6DRepNet's get_R is R_U transposed; TriNet's is S R_C S."""
    yaw, pitch, roll = np.deg2rad(A)

    def x(a: float) -> np.ndarray:
        return np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])

    def y(a: float) -> np.ndarray:
        return np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])

    def z(a: float) -> np.ndarray:
        return np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])

    made = rot.rotation_from_angles(np.array(A))
    assert np.allclose(z(roll) @ y(yaw) @ x(pitch), rot.graphics_rotation(made).T)
    assert np.allclose(x(pitch) @ y(-yaw) @ z(roll), rot.MIRROR @ made @ rot.MIRROR)


def test_geodesic() -> None:
    base = rot.rotation_from_angles(np.array(A))
    for angle in (0.0, 1e-7, 1.0, 90.0, 179.9999):
        turned = base @ rot.rotation_from_angles(np.array([0, 0, angle]))
        assert rot.geodesic_deg(base, turned) == pytest.approx(angle, abs=1e-9)


def test_order_of_axes_matters() -> None:
    """The reason for all of this: read in another order, the same angles are another pose."""
    made = rot.rotation_from_angles(np.array(A))
    other = Rotation.from_euler("YXZ", [A[0], -A[1], A[2]], degrees=True).as_matrix()
    assert 32 < rot.geodesic_deg(made, other) < 34


@pytest.mark.parametrize("bad", [np.zeros(2), np.array([0, np.nan, 0]), np.array([np.inf, 0, 0])])
def test_bad_angles(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="yaw"):
        rot.rotation_from_angles(bad)

# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.geometry.metrics import axis_errors, euler_errors, geodesic_errors
from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation, rotation_from_angles

# docs/conventions.md, test vectors.
VECTORS = [
    ((50, 40, 30), [0.556670399, -0.321393805, 0.766044443, -0.043412044, 0.909615886, 0.413175911,
                    -0.829598373, -0.263258355, 0.492403877]),
    ((-35, 12.5, -7), [0.813046209, 0.099829522, -0.573576436, 0.004238754, 0.984148273, 0.177296952,
                       0.582183729, -0.146581864, 0.799734870]),
]  # fmt: skip


@pytest.mark.parametrize(("ypr", "rotation"), VECTORS)
def test_conventions(ypr, rotation):
    expected = np.reshape(rotation, (3, 3))
    np.testing.assert_allclose(rotation_from_angles(np.array(ypr)), expected, atol=1e-9)
    np.testing.assert_allclose(angles_from_rotation(expected), ypr, atol=1e-6)


def test_rigid_fit_recovers_rotations_and_never_mirrors():
    rng = np.random.default_rng(0)
    face = rng.normal(size=(468, 3))
    true = rotation_from_angles(rng.uniform(-80, 80, size=(20, 3)))
    seen = 7.5 * face @ np.swapaxes(true, -1, -2) + rng.normal(size=(20, 1, 3))
    np.testing.assert_allclose(fit_rotation(face, seen), true, atol=1e-12)
    mirrored = fit_rotation(face, seen * [-1, 1, 1])
    np.testing.assert_allclose(np.linalg.det(mirrored), 1.0)


def test_errors_of_a_known_turn():
    true = rotation_from_angles(np.array([20.0, 10, 5]))
    turn = rotation_from_angles(np.array([0.0, 0, 12]))  # about one axis: that axis has no error
    np.testing.assert_allclose(geodesic_errors(true @ turn, true), 12.0, atol=1e-9)
    np.testing.assert_allclose(axis_errors(true @ turn, true), [12, 12, 0], atol=1e-6)


def test_errors_are_exact_at_both_ends():
    true = rotation_from_angles(np.array([[0.0, 0, 0], [0, 0, 0]]))
    near = rotation_from_angles(np.array([[1e-6, 0, 0], [0, 180, 0]]))
    np.testing.assert_allclose(geodesic_errors(near, true), [1e-6, 180], rtol=1e-6)
    # 6DRepNet's script would call the second one right.
    np.testing.assert_allclose(euler_errors([[0, 0, 0], [0, 180, 0]], [[1, 0, 0], [0, 0, 0]])[1], [0, 180, 0])

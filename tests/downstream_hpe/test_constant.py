# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.constant import constant, folds_of
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles

OFFSET = np.array([1.0, -6.0, 2.0])


def estimates(noise_deg: float = 0.0, subjects: int = 20, seed: int = 3):
    """Estimates whose zero is OFFSET away from that of the labels, ten a subject."""
    rng = np.random.default_rng(seed)
    true = rotation_from_angles(rng.uniform(-1, 1, size=(10 * subjects, 3)) * [50, 40, 30])
    predicted = true @ rotation_from_angles(OFFSET)
    shaken = predicted @ rotation_from_angles(noise_deg * rng.normal(size=(len(true), 3)))
    return angles_from_rotation(shaken), true, np.repeat([f"s{n:02d}" for n in range(subjects)], 10)


def test_a_constant_is_found_and_taken_out():
    found = constant(*estimates())
    np.testing.assert_allclose(found.ypr_deg, OFFSET, atol=1e-9)
    assert found.mean_mae < 1e-9
    assert found.geodesic < 1e-9
    assert found.folds == 5


def test_its_interval_mostly_holds_it_and_narrows_with_subjects():
    found = [constant(*estimates(4.0, 40, seed)) for seed in range(20)]
    held = [(low < OFFSET) & (high > OFFSET) for low, high in (one.interval_deg for one in found)]
    assert 0.85 < np.mean(held) < 1
    many = constant(*estimates(4.0, 400))
    assert (np.ptp(many.interval_deg, axis=0) < 0.5 * np.ptp(found[0].interval_deg, axis=0)).all()


def test_it_is_not_found_on_the_rows_it_is_taken_from():
    """Two subjects with opposite offsets: each one's own would leave nothing, the other's doubles it."""
    _, true, _ = estimates(subjects=2)
    turned = np.repeat([rotation_from_angles([0, 5, 0]), rotation_from_angles([0, -5, 0])], 10, axis=0)
    found = constant(angles_from_rotation(true @ turned), true, np.repeat(["a", "b"], 10))
    assert found.folds == 2
    np.testing.assert_allclose(found.geodesic, 10, atol=1e-6)
    np.testing.assert_allclose(found.ypr_deg, 0, atol=1e-9)


def test_no_subject_is_in_two_folds_and_one_alone_is_cut_into_runs():
    subjects = np.array(list("abcabcabc"))
    fold = folds_of(subjects, 2)
    assert all(len(set(fold[subjects == name])) == 1 for name in "abc")
    assert folds_of(np.array(["one"] * 6), 3).tolist() == [0, 0, 1, 1, 2, 2]
    assert np.isnan(constant(*estimates(subjects=1)).interval_deg).all()
    with pytest.raises(DataError, match="1 rows and 5 folds"):
        constant(np.zeros((1, 3)), np.eye(3)[None], np.array(["a"]))

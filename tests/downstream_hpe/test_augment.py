# SPDX-License-Identifier: MIT
from __future__ import annotations

from dataclasses import replace

import ideal
import numpy as np
import pytest

from downstream_hpe.geometry.face_mesh import mirror_pairs
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.networks.augment import NONE, disturbed, levelled, shapes_of

COUNT = 40


@pytest.fixture(scope="module")
def faces():
    """Level faces of four heads, at ten poses each."""
    heads = np.repeat(ideal.Faces().draw(4, np.random.default_rng(0)), 10, axis=0).astype(np.float32)
    ypr = np.random.default_rng(1).uniform(-30, 30, size=(COUNT, 3))
    return heads, rotation_from_angles(ypr), ypr, np.repeat(["a", "b", "c", "d"], 10)


def run(faces, **how):
    level, rotation, ypr, names = faces
    shapes = shapes_of(level, names, ypr)
    return disturbed(level, rotation, shapes, replace(NONE, **how), np.random.default_rng(2))


def test_levelling_undoes_the_pose(faces):
    level, rotation, ypr, _ = faces
    np.testing.assert_allclose(levelled(ideal.turned(level, ypr), rotation), level, atol=1e-5)


def test_landmarks_and_label_turn_together(faces):
    turned, rotation = run(faces, turn_deg=6)
    assert 3 < np.abs(angles_from_rotation(rotation) - faces[2]).mean() < 8
    np.testing.assert_allclose(turned @ rotation, faces[0], atol=1e-4)


def test_a_mirrored_face_looks_the_other_way(faces):
    turned, rotation = run(faces, mirror=1)
    np.testing.assert_allclose(angles_from_rotation(rotation), faces[2] * [-1, 1, -1], atol=1e-9)
    straight, _ = run(faces)
    np.testing.assert_allclose(turned, straight[:, mirror_pairs()] * [-1, 1, 1], atol=1e-4)


def test_mirror_pairs_are_those_of_the_face_mesh():
    pairs = mirror_pairs()
    np.testing.assert_array_equal(pairs[pairs], np.arange(468))
    # Outer and inner eye corners, corners of the mouth, sides of the face; nose, chin and brow stay.
    assert [int(pairs[k]) for k in (33, 133, 61, 234, 1, 152, 10)] == [263, 362, 291, 454, 1, 152, 10]


def test_new_shapes_are_mixtures_of_the_heads_and_keep_the_label(faces):
    turned, rotation = run(faces, shape=0.5)
    np.testing.assert_array_equal(rotation, faces[1])
    change = (turned @ rotation - faces[0]).reshape(COUNT, -1)
    assert np.linalg.norm(change, axis=1).min() >= 0 and np.linalg.norm(change, axis=1).mean() > 1
    differences = (faces[0][::10] - faces[0][0]).reshape(4, -1)[1:]
    left = change - change @ np.linalg.pinv(differences) @ differences
    assert np.abs(left).max() < 1e-3


@pytest.mark.parametrize("how", ["stretch", "depth", "lean", "lens", "jitter"])
def test_each_disturbance_moves_points_and_no_label(faces, how):
    turned, rotation = run(faces, **{how: 0.05})
    still, _ = run(faces)
    np.testing.assert_array_equal(rotation, faces[1])
    assert 1e-3 < np.abs(turned - still).mean() < 0.2

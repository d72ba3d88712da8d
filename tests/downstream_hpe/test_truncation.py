# SPDX-License-Identifier: MIT
"""Which faces are not learned from, because their dataset ends where another goes on."""

from __future__ import annotations

import ideal
import numpy as np

from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation, rotation_from_angles
from downstream_hpe.networks.truncation import FURTHER_DEG, NEAR_DEG, untruncated
from downstream_hpe.tables.rows import Rows


def dataset(reach, read, count=2000, seed=0):
    """Yaw up to reach; what a detector reads is a share of it, and a little noise."""
    rng = np.random.default_rng(seed)
    ypr = np.column_stack([rng.uniform(-reach, reach, count), rng.uniform(-20, 20, (count, 2))])
    seen = ypr * [read, 1, 1] + rng.normal(scale=3, size=(count, 3))
    names = np.array([f"s{n}/neutral" for n in range(count)])
    faces = ideal.turned(np.broadcast_to(mean_head(), (count, 468, 3)), seen)
    return Rows(names, names, ypr, rotation_from_angles(ypr), faces.astype(np.float32), 0)


def turned_further(rows, low, high):
    """By how much those who read as low to high are turned further, on average."""
    read = angles_from_rotation(fit_rotation(mean_head(), rows.landmarks.astype(float)))[:, 0]
    inside = (np.abs(read) > low) & (np.abs(read) < high)
    return float((np.abs(rows.ypr_deg[inside, 0]) - np.abs(read[inside])).mean())


def test_what_is_left_says_what_the_wide_dataset_says():
    narrow, wide = dataset(45, 0.85, seed=1), dataset(85, 0.85, seed=2)
    kept = untruncated([narrow, wide], mean_head())
    assert len(kept[1]) == len(wide)
    assert 0.5 * len(narrow) < len(kept[0]) < len(narrow)
    expected = turned_further(wide, 33, 45)
    assert turned_further(Rows.joined([narrow, wide]), 33, 45) < expected - 1
    assert abs(turned_further(Rows.joined(kept), 33, 45) - expected) < 0.1


def test_datasets_that_end_alike_are_whole():
    both = [dataset(45, 0.85), dataset(45 + FURTHER_DEG - NEAR_DEG, 0.85)]
    assert [len(rows) for rows in untruncated(both, mean_head())] == [2000, 2000]


def test_partial_faces_are_exact_and_stay():
    narrow, wide = dataset(45, 0.85, seed=1), dataset(85, 0.85, seed=2)
    narrow.landmarks[:, 100:] = np.nan
    assert len(untruncated([narrow, wide], mean_head())[0]) == len(narrow)

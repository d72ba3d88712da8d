# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rows verify --deep looks at."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from small_dataset import HEADS

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.proof.choose import choose_rows
from generator.plan.pose_plans import PosePlans
from generator.plan.poses import uniform_plan

NAMES = ("s0", "s1", "s2")
THREE = [replace(HEADS[0], subject=name) for name in NAMES]
PLANS = zip(NAMES, (uniform_plan(4, 1), uniform_plan(200, 2), uniform_plan(200, 3)), strict=True)
POSES = DatasetPoses(THREE, PosePlans(None, {(name, "neutral"): plan for name, plan in PLANS}))


@pytest.mark.parametrize("count", [1, 2, 3, 7, 12, 13, 50, 151, 400, 404, 1000, None])
def test_they_are_spread_over_heads(count: int | None) -> None:
    chosen = list(choose_rows(THREE, POSES, count, 5))
    wanted = 404 if count is None else min(count, 404)
    assert len(chosen) == len(set(chosen)) == wanted
    subjects = [name.split("/")[0] for name in chosen]
    assert subjects == sorted(subjects), "head by head, so that each is loaded once"
    shares = [subjects.count(name) for name in NAMES]
    even = [min(share, 4) if name == "s0" else share for name, share in zip(NAMES, shares, strict=True)]
    assert shares == even and abs(shares[1] - shares[2]) <= 1
    assert shares[0] == 4 or max(shares) - min(shares) <= 1


def test_the_seed_chooses() -> None:
    first, again, other = (set(choose_rows(THREE, POSES, 50, seed)) for seed in (0, 0, 1))
    assert first == again != other
    seen = Counter(name for seed in range(30) for name in choose_rows(THREE, POSES, 50, seed))
    assert len(seen) > 390, "in the end every row has its turn"


def test_nothing_of_nothing() -> None:
    assert list(choose_rows([], DatasetPoses([], PosePlans(uniform_plan(4, 1))), 5)) == []

# SPDX-License-Identifier: GPL-3.0-or-later
"""The timeline is the plan of the build, kind by kind."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from blender_addon.core import grid
from generator.errors import UsageError
from generator.execution.preview.server import PreviewServer
from generator.plan.config import BuildConfig, load_config
from generator.plan.pose_plans import plan_poses
from generator.plan.settings import Poses

ANNA, BERT = ("anna", "neutral"), ("bert", "smile")


def test_the_default_grid() -> None:
    plan = grid.plan_poses(Poses(), ANNA)
    assert (plan.angles_deg == plan_poses(BuildConfig(), []).of(*ANNA).angles_deg).all() and len(plan) == 693
    assert grid.snapped(13.0, (-50, 50, 10)) == 10 and grid.snapped(99.0, (-50, 50, 10)) == 50
    assert len(set(grid.extremes(Poses()))) == 9
    assert grid.extremes(Poses())[0] == (-50, 40, -30)


@pytest.mark.parametrize("same", [False, True])
@pytest.mark.parametrize("kind", ["uniform", "sobol", "csv", "grid"])
def test_every_plan_of_the_build_is_on_the_timeline(kind: str, same: bool, tmp_path: Path) -> None:
    table = tmp_path / "poses.csv"
    table.write_text("yaw_deg,pitch_deg,roll_deg\n5,1,2\n-5,0,7\n", encoding="utf-8")
    values = {"kind": kind, "count": 9, "seed": 3, "same": same, "path": str(table)}
    if kind not in ("grid", "csv"):
        values["yaw"] = [10, 50]
    config = load_config(None, {"poses": values})
    drawn = kind == "sobol" or (kind == "uniform" and not same)
    plans = plan_poses(config, [ANNA, BERT])
    for subject, expression in (ANNA, BERT):
        if drawn and (subject == "anna" or not same):
            with pytest.raises(grid.NotDrawn):
                grid.plan_poses(config.poses, (subject, expression))
            file = tmp_path / "p.npy"
            request = {"op": "plan", "config": {"poses": values}, "file": str(file)}
            answer = PreviewServer(tmp_path, ExitStack()).answer(
                {**request, "subject": subject, "expression": expression}
            )
            assert answer == {"count": 9}
            grid.remember(config.poses, (subject, expression), file)
        found, planned = grid.plan_poses(config.poses, (subject, expression)), plans.of(subject, expression)
        assert (found.angles_deg == planned.angles_deg).all()
        assert (found.indices == planned.indices).all()
    ours = [grid.plan_poses(config.poses, head).angles_deg for head in (ANNA, BERT)]
    assert grid.has_own(config.poses) == (kind in ("uniform", "sobol") and not same)
    assert np.array_equal(*ours) != grid.has_own(config.poses)


def test_only_so_many_drawn_plans_are_kept(tmp_path: Path) -> None:
    np.save(tmp_path / "p.npy", np.array([[1.0, 2.0, 3.0]]))
    poses = Poses(kind="sobol", count=1)
    for k in range(grid.KEPT + 1):
        grid.remember(poses, (str(k), "neutral"), tmp_path / "p.npy")
    with pytest.raises(grid.NotDrawn):
        grid.plan_poses(poses, ("0", "neutral"))
    assert len(grid.plan_poses(poses, (str(grid.KEPT), "neutral"))) == 1


def test_a_plan_that_makes_no_sense_is_refused_before_it_is_drawn() -> None:
    with pytest.raises(UsageError, match="swap the two"):
        grid.plan_poses(Poses(kind="uniform", yaw=(50.0, -50.0)), ANNA)
    with pytest.raises(UsageError, match="takes low and high"):
        grid.plan_poses(Poses(kind="uniform", yaw=(-5.0, 5.0, 1.0)), ANNA)
    with pytest.raises(UsageError, match="choose the CSV file"):
        grid.plan_poses(Poses(kind="csv"), ANNA)


def test_a_table_that_changed_is_read_again(tmp_path: Path) -> None:
    table = tmp_path / "poses.csv"
    poses = Poses(kind="csv", path=str(table))
    for row, stamp in (("5,1,2", 1), ("7,1,2", 2)):
        table.write_text(f"yaw,pitch,roll\n{row}\n-5,0,7\n", encoding="utf-8")
        os.utime(table, (stamp, stamp))
        assert grid.plan_poses(poses, ANNA).angles_deg[-1, 0] == int(row[0])
    assert grid.extremes(poses)[:2] == [(-5, 1, 2), (0, 1, 2)]
    assert {yaw for yaw, _, _ in grid.extremes(Poses(kind="sobol", yaw=(10.0, 50.0)))} == {10, 50}

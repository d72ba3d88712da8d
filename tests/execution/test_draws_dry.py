# SPDX-License-Identifier: GPL-3.0-or-later
"""Random poses, a draw of its own for each head or one for all, in builds without a renderer."""

from __future__ import annotations

import pyarrow.parquet as pq
import pytest
from dry_build import DRAWN, DryBuild

from generator.errors import DatasetError
from generator.execution.build.folder import CONFIG_FILE
from generator.plan.config import read_recorded
from generator.plan.pose_plans import POSES_FILE, read_pose_plans

SAME = {**DRAWN, "same": True}


@pytest.mark.parametrize("kind", ["sobol", "uniform"])
def test_every_head_has_poses_of_its_own(dry: DryBuild, kind: str) -> None:
    dry.build(poses={**DRAWN, "kind": kind})
    amy, bob = dry.poses_of("amy"), dry.poses_of("bob")
    assert len(amy) == len(bob) == 6
    assert not amy & bob
    assert all(row["yaw_index"] == -1 for row in dry.rows)
    dry.check()


def test_the_draw_depends_on_the_head_and_the_seed_alone(dry: DryBuild) -> None:
    dry.build(poses=DRAWN)
    amy, parts = dry.poses_of("amy"), dry.parts
    dry.add("abe", "zoe")
    dry.build(poses=DRAWN)
    assert dry.poses_of("amy") == amy and set(parts) < set(dry.parts)
    assert {name.split("/")[0] for name in dry.rendered} == {"abe", "zoe"}
    dry.check()

    alone = DryBuild(dry.root.parent / "alone", "amy")
    alone.build(poses=DRAWN)
    assert alone.poses_of("amy") == amy
    alone.build(poses={**DRAWN, "seed": 1}, confirm=lambda what: True)
    assert not alone.poses_of("amy") & amy


def test_more_poses_are_drawn_after_those_that_are_there(dry: DryBuild) -> None:
    dry.build(poses=DRAWN)
    old = {row["sample_id"] for row in dry.rows}
    dry.build(poses={**DRAWN, "count": 11})
    assert not old & set(dry.rendered) and len(dry.rendered) == 2 * 5
    dry.check()
    at_once = DryBuild(dry.root.parent / "at_once", "amy", "bob")
    at_once.build(poses={**DRAWN, "count": 11})
    assert at_once.digest == dry.digest


def test_the_same_poses_for_every_head_where_they_are_asked_for(dry: DryBuild) -> None:
    dry.build(poses=SAME)
    assert dry.poses_of("amy") == dry.poses_of("bob")
    assert read_pose_plans(dry.root / POSES_FILE).shared is not None
    dry.check()


@pytest.mark.parametrize("says_nothing", [True, False], ids=["of the first release", "of today"])
def test_a_dataset_goes_on_as_it_was_begun(dry: DryBuild, says_nothing: bool) -> None:
    """Draws of their own would replace every row of one whose heads share theirs."""
    dry.build(poses=SAME)
    poses, parts = dry.poses_of("amy"), dry.parts
    file = dry.root / CONFIG_FILE
    if says_nothing:
        text = file.read_text()
        assert "same = true\n" in text
        file.write_text(text.replace("same = true\n", ""))
    dry.add("cat")
    dry.build(poses=DRAWN)
    assert "every head gets the same poses, as this dataset was begun" in dry.said.notes
    assert {name.split("/")[0] for name in dry.rendered} == {"cat"}
    assert dry.poses_of("cat") == poses and set(parts) < set(dry.parts)
    assert read_recorded(file).poses.same
    dry.check()


def test_draws_of_their_own_go_on_without_being_asked_for(dry: DryBuild) -> None:
    dry.build(poses=DRAWN)
    dry.build(poses=DRAWN)
    assert not dry.rendered and not any("same poses" in note for note in dry.said.notes)


def test_from_own_draws_to_the_same_only_when_that_was_agreed_to(dry: DryBuild) -> None:
    dry.build(poses=DRAWN)
    with pytest.raises(DatasetError, match=r"4 parts .* will be deleted"):
        dry.build(poses=SAME)
    dry.build(poses=SAME, confirm=lambda what: True)
    assert dry.poses_of("amy") == dry.poses_of("bob")
    dry.check()


def test_colours_behind_heads_are_drawn_recorded_and_proved(dry: DryBuild) -> None:
    dry.build(render={"background": ["uniform:0,1", 0.25, "head:uniform:0,1"]})
    table = pq.read_table(dry.root / "data", columns=["subject", "look_background"]).to_pylist()
    red, green, blue = zip(*(row["look_background"] for row in table), strict=True)
    assert len(set(red)) == len(table) and set(green) == {0.25}
    assert len(set(zip((row["subject"] for row in table), blue, strict=True))) == 2
    dry.check()


def test_from_a_grid_to_draws(dry: DryBuild) -> None:
    """No random poses were begun, so each head draws its own."""
    dry.build()
    dry.build(poses=DRAWN, confirm=lambda what: True)
    assert not dry.poses_of("amy") & dry.poses_of("bob")
    dry.check()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Which poses are built together: all of them, once, and those that were together stay so."""

from __future__ import annotations

import tempfile
from math import ceil
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from generator.execution.build.chunks import Chunk, ChunkedPoses, chunk_poses
from generator.plan.pose_plans import PosePlans, poses_csv, read_pose_plans
from generator.plan.poses import PosePlan, plan_of
from generator.plan.views import Pose

AXIS = (0.1, 20.0, -7.0)
POSE = st.tuples(*[st.sampled_from(AXIS)] * 3)
POSES = st.sets(POSE, min_size=1, max_size=25)
SIZE = st.integers(1, 7)
HEADS = (("amy", "neutral"), ("bob", "smile"))


def plan(poses: set[Pose], *, grid: bool = False) -> PosePlan:
    """A plan of these poses; in a grid of their values, or off any."""
    rows = np.array(sorted(poses))
    places = [
        [sorted(set(rows[:, k])).index(value) if grid else -1 for k, value in enumerate(row)] for row in rows
    ]
    return plan_of(rows, np.array(places))[0]


def kept(poses: ChunkedPoses) -> PosePlans:
    """What the next build knows of them: what stands in poses.csv."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "poses.csv"
        file.write_text(poses_csv(poses.plans))
        return read_pose_plans(file)


def sets(chunks: list[Chunk]) -> set[frozenset[Pose]]:
    """The poses of each."""
    return {frozenset(chunk.poses) for chunk in chunks}


def check(chunks: list[Chunk], whole: PosePlan, size: int) -> None:
    """Every pose of a plan is in one chunk, in the plan's order, with its place; none is too large."""
    places = dict(zip(map(tuple, whole.angles_deg.tolist()), map(tuple, whole.indices.tolist()), strict=True))
    built = [pose for chunk in chunks for pose in chunk.poses]
    assert sorted(built) == list(places)
    for chunk in chunks:
        assert 1 <= len(chunk.poses) <= size
        assert list(chunk.poses) == sorted(chunk.poses)
        assert chunk.indices == tuple(places[pose] for pose in chunk.poses)


@given(POSES, SIZE)
def test_a_first_plan_is_cut_into_as_few_as_can_be(poses: set[Pose], size: int) -> None:
    chunks = chunk_poses(PosePlans(plan(poses)), size, None).of("amy", "neutral")
    check(chunks, plan(poses), size)
    assert len(chunks) == ceil(len(poses) / size)
    assert all(chunk.earlier_indices is None for chunk in chunks)


@given(st.lists(POSES, min_size=2, max_size=4), SIZE, st.booleans())
def test_what_was_built_together_stays_so_while_a_plan_grows(grows: list[set], size: int, grid: bool) -> None:
    poses: set[Pose] = set()
    earlier, before = None, set[frozenset[Pose]]()
    for more in grows:
        new = more - poses
        poses |= more
        chunked = chunk_poses(PosePlans(plan(poses, grid=grid)), size, earlier)
        chunks = chunked.of("amy", "neutral")
        check(chunks, plan(poses, grid=grid), size)
        assert before <= sets(chunks)
        assert len(chunks) - len(before) == ceil(len(new) / size), "what is new is cut by itself"
        earlier, before = kept(chunked), sets(chunks)


@given(st.lists(POSES, min_size=2, max_size=4), SIZE)
def test_chunks_that_lost_a_pose_are_cut_anew_with_what_is_new(plans: list[set], size: int) -> None:
    earlier, before = None, set[frozenset[Pose]]()
    for poses in plans:
        chunked = chunk_poses(PosePlans(plan(poses)), size, earlier)
        chunks = chunked.of("amy", "neutral")
        check(chunks, plan(poses), size)
        whole = {chunk for chunk in before if chunk <= poses}
        assert whole <= sets(chunks)
        loose = len(poses) - sum(map(len, whole))
        assert len(chunks) == len(whole) + ceil(loose / size)
        earlier, before = kept(chunked), sets(chunks)


@given(POSES, POSES, SIZE)
def test_chunks_know_the_places_they_had_where_these_changed(first: set, second: set, size: int) -> None:
    """And only those that were built before, with these very poses."""
    before = plan(first, grid=True)
    earlier = chunk_poses(PosePlans(before), size, None)
    places = dict(
        zip(map(tuple, before.angles_deg.tolist()), map(tuple, before.indices.tolist()), strict=True)
    )
    for chunk in chunk_poses(PosePlans(plan(second, grid=True)), size, kept(earlier)).of("amy", "neutral"):
        if frozenset(chunk.poses) in sets(earlier.of("amy", "neutral")):
            had = tuple(places[pose] for pose in chunk.poses)
            assert chunk.earlier_indices == (had if had != chunk.indices else None)
        else:
            assert chunk.earlier_indices is None


@given(st.tuples(POSES, POSES), st.tuples(POSES, POSES), SIZE)
def test_every_head_has_chunks_of_its_own_poses(first: tuple, more: tuple, size: int) -> None:
    plans = PosePlans(None, dict(zip(HEADS, map(plan, first), strict=True)))
    chunked = chunk_poses(plans, size, None)
    grown = [old | new for old, new in zip(first, more, strict=True)]
    later = chunk_poses(PosePlans(None, dict(zip(HEADS, map(plan, grown), strict=True))), size, kept(chunked))
    for head, old, new in zip(HEADS, first, grown, strict=True):
        check(chunked.of(*head), plan(old), size)
        check(later.of(*head), plan(new), size)
        assert sets(chunked.of(*head)) <= sets(later.of(*head))
        alone = chunk_poses(PosePlans(None, {head: plan(old)}), size, None)
        assert sets(alone.of(*head)) == sets(chunked.of(*head)), "whatever other heads there are"


@given(POSES, POSES, SIZE)
def test_a_head_that_comes_later_has_no_past(first: set, second: set, size: int) -> None:
    chunked = chunk_poses(PosePlans(None, {HEADS[0]: plan(first)}), size, None)
    both = PosePlans(None, {HEADS[0]: plan(first), HEADS[1]: plan(second)})
    later = chunk_poses(both, size, kept(chunked))
    assert sets(later.of(*HEADS[0])) == sets(chunked.of(*HEADS[0]))
    check(later.of(*HEADS[1]), plan(second), size)
    assert len(later.of(*HEADS[1])) == ceil(len(second) / size)


@given(POSES, SIZE)
def test_shared_poses_are_cut_once_for_all_heads(poses: set[Pose], size: int) -> None:
    chunked = chunk_poses(PosePlans(plan(poses)), size, None)
    assert chunked.of("amy", "neutral") is chunked.of("bob", "smile")

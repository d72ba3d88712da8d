# SPDX-License-Identifier: GPL-3.0-or-later
"""Which poses are built together: chunks that stay the same when a plan grows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from generator.plan.pose_plans import HeadName, PosePlans
from generator.plan.poses import PosePlan
from generator.plan.views import Pose

Indices = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some poses of a plan, in its order; the units of all heads with this plan share these tuples.

    poses, indices: rows of the plan. earlier_indices: what the indices of the same
    poses were before the plan grew, None if nothing changed.
    """

    poses: tuple[Pose, ...]
    indices: tuple[Indices, ...]
    earlier_indices: tuple[Indices, ...] | None = None


@dataclass(frozen=True)
class Earlier:
    """The poses of a plan as they were built before. chunk, indices: of each pose."""

    chunk: Mapping[Pose, int]
    indices: Mapping[Pose, Indices]


NOTHING_EARLIER = Earlier({}, {})


@dataclass(frozen=True, eq=False)
class ChunkedPoses:
    """The poses of every head, cut into chunks.

    plans: with the number of each pose's chunk. shared: the chunks of all heads, None where each has its
    own, which are in by_head.
    """

    plans: PosePlans
    shared: list[Chunk] | None
    by_head: Mapping[HeadName, list[Chunk]]

    def of(self, subject: str, expression: str) -> list[Chunk]:
        """The chunks of a head."""
        return self.by_head[subject, expression] if self.shared is None else self.shared


def chunk_poses(plans: PosePlans, size: int, earlier: PosePlans | None) -> ChunkedPoses:
    """Cut plans into chunks of at most size poses; what was built before stays together.

    earlier: of the dataset as it is, None if there is none.
    """
    if plans.shared is not None:
        before = _earlier(earlier, None) if earlier is not None else NOTHING_EARLIER
        numbers = assign_chunks(plans.shared, size, before)
        chunked = PosePlans(plans.shared, {}, {None: numbers})
        return ChunkedPoses(chunked, cut(plans.shared, numbers, before), {})
    numbers_of: dict[HeadName | None, np.ndarray] = {}
    by_head: dict[HeadName, list[Chunk]] = {}
    for head, plan in plans.by_head.items():
        before = _earlier(earlier, head) if earlier is not None else NOTHING_EARLIER
        numbers_of[head] = assign_chunks(plan, size, before)
        by_head[head] = cut(plan, numbers_of[head], before)
    return ChunkedPoses(PosePlans(None, plans.by_head, numbers_of), None, by_head)


def _earlier(plans: PosePlans, head: HeadName | None) -> Earlier:
    """What was built of a head, or of all of them (None)."""
    plan = plans.shared if plans.shared is not None else plans.by_head.get(head or ("", ""))
    numbers = plans.chunks.get(None if plans.shared is not None else head)
    if plan is None or numbers is None:
        return NOTHING_EARLIER
    poses = _tuples(plan.angles_deg)
    return Earlier(
        dict(zip(poses, numbers.tolist(), strict=True)),
        dict(zip(poses, _tuples(plan.indices), strict=True)),
    )


def assign_chunks(plan: PosePlan, size: int, earlier: Earlier) -> np.ndarray:
    """Number of the chunk of each pose, int64 [N].

    Chunks whose poses are all still there stay together; the other poses are cut, in
    the order of the plan, into new chunks of at most size poses.
    """
    poses = _tuples(plan.angles_deg)
    known = set(poses)
    broken = {number for pose, number in earlier.chunk.items() if pose not in known}
    numbers = np.array([earlier.chunk.get(pose, -1) for pose in poses], dtype=np.int64)
    numbers[np.isin(numbers, list(broken))] = -1
    new = np.flatnonzero(numbers < 0)
    first = max(earlier.chunk.values(), default=-1) + 1
    numbers[new] = first + np.arange(len(new)) // size
    return numbers


def cut(plan: PosePlan, numbers: np.ndarray, earlier: Earlier) -> list[Chunk]:
    """The chunks of a plan, in the order of their numbers."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
    chunks = []
    for rows in np.split(order, starts[1:]):
        poses, indices = _tuples(plan.angles_deg[rows]), _tuples(plan.indices[rows])
        known = {earlier.chunk.get(pose) for pose in poses}
        before = None
        if known == {int(numbers[rows[0]])}:
            before = tuple(earlier.indices[pose] for pose in poses)
        chunks.append(Chunk(poses, indices, before if before != indices else None))
    return chunks


def _tuples(rows: np.ndarray) -> tuple:
    """[N, 3] as N tuples of plain numbers."""
    return tuple(map(tuple, rows.tolist()))

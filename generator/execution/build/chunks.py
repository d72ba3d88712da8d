# SPDX-License-Identifier: GPL-3.0-or-later
"""Which poses are built together: chunks that stay the same when a plan grows."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generator.errors import DatasetError
from generator.plan.poses import ANGLES, PosePlan

CHUNK_COLUMN = "chunk"
Pose = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some poses of a plan, in its order; every head's units share these lists.

    poses, indices: rows of the plan. earlier_indices: what the indices of the same
    poses were before the plan grew, None if nothing changed.
    """

    poses: list[list[float]]
    indices: list[list[int]]
    earlier_indices: list[list[int]] | None = None


@dataclass(frozen=True)
class Earlier:
    """The poses of a dataset as they were built before. chunk, indices: of each pose."""

    chunk: dict[Pose, int]
    indices: dict[Pose, list[int]]


def read_earlier(poses_csv: Path) -> Earlier:
    """What poses.csv of an earlier build says; nothing if there is none.

    Raises DatasetError if it is not such a file.
    """
    earlier = Earlier({}, {})
    if not poses_csv.exists():
        return earlier
    try:
        with poses_csv.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                pose = tuple(float(row[f"{name}_deg"]) for name in ANGLES)
                earlier.chunk[pose] = int(row[CHUNK_COLUMN])
                earlier.indices[pose] = [int(row[f"{name}_index"]) for name in ANGLES]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"{poses_csv}: not the poses of an earlier build ({error}); build again with --fresh"
        ) from error
    return earlier


def assign_chunks(plan: PosePlan, size: int, earlier: Earlier) -> np.ndarray:
    """Number of the chunk of each pose, int64 [N].

    Chunks whose poses are all still there stay together; the other poses are cut, in
    the order of the plan, into new chunks of at most size poses.
    """
    poses = [tuple(pose) for pose in plan.angles_deg.tolist()]
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
        poses, indices = plan.angles_deg[rows].tolist(), plan.indices[rows].tolist()
        known = {earlier.chunk.get(tuple(pose)) for pose in poses}
        before = None
        if known == {int(numbers[rows[0]])}:
            before = [earlier.indices[tuple(pose)] for pose in poses]
        chunks.append(Chunk(poses, indices, before if before != indices else None))
    return chunks

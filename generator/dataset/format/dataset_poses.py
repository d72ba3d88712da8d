# SPDX-License-Identifier: GPL-3.0-or-later
"""The poses of a dataset's heads by number: the place of a head in heads.parquet, of a pose in its plan."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.open import as_array
from generator.errors import DatasetError
from generator.plan.pose_plans import POSES_FILE, PosePlans, read_pose_plans
from generator.plan.poses import ANGLES, PosePlan, pose_name


class DatasetPoses:
    """Finds poses and rows, many at a time: there may be millions.

    Raises DatasetError if a head has no poses.
    """

    def __init__(self, heads: Sequence[HeadRow], plans: PosePlans) -> None:
        self.plans = plans
        names = [(head.subject, head.expression) for head in heads]
        self._head_index = {name: place for place, name in enumerate(names)}
        found: dict[int, int] = {}
        self._unique: list[PosePlan] = []
        self._plan_of = np.zeros(len(names), np.int64)
        for place, name in enumerate(names):
            try:
                plan = plans.of(*name)
            except KeyError as error:
                raise DatasetError(
                    f"{POSES_FILE}: no poses of {'/'.join(name)}; run `headturn build` again"
                ) from error
            if id(plan) not in found:
                found[id(plan)] = len(self._unique)
                self._unique.append(plan)
            self._plan_of[place] = found[id(plan)]
        lengths = np.array([len(plan) for plan in self._unique], np.int64)
        self._start = np.concatenate([[0], np.cumsum(lengths)])[:-1]
        self.counts = lengths[self._plan_of]
        """Poses of each head, int64 [heads]."""
        self._finders: dict[int, _Finder] = {}

    @property
    def rows(self) -> int:
        """Rows of all heads."""
        return int(self.counts.sum())

    @property
    def most(self) -> int:
        """Poses of the head with most of them."""
        return int(self.counts.max(initial=0))

    @property
    def on_grid(self) -> bool:
        """Do all poses have a place in a grid?"""
        return all((plan.indices >= 0).all() for plan in self._unique)

    def plan(self, head: int) -> PosePlan:
        """The plan of a head."""
        return self._unique[self._plan_of[head]]

    def name(self, head: int, pose: int) -> str:
        """The name of a pose, such as "y+10_p-20_r+0"."""
        return pose_name(*self.plan(head).angles_deg[pose].tolist())

    def indices(self, heads: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Places in the grid, int16 [N, 3]. heads, poses: int [N]."""
        return self._all_indices[self._start[self._plan_of[heads]] + poses]

    def flat_angles(self) -> tuple[np.ndarray, np.ndarray]:
        """Every plan's poses in a row, float64 [P, 3], and where each head's begin, int64 [heads]."""
        return self._all_angles, self._start[self._plan_of]

    def of(self, table: pa.Table | pa.RecordBatch) -> tuple[np.ndarray, np.ndarray]:
        """int32 [N]: the head and the pose of each row, -1 where unknown."""
        heads = self._heads_of(table)
        angles = np.stack([as_array(table, f"{name}_deg") for name in ANGLES], axis=-1)
        poses = np.full(len(heads), -1, np.int32)
        plans = np.where(heads >= 0, self._plan_of[heads], -1)
        for plan in np.unique(plans[plans >= 0]).tolist():
            rows = plans == plan
            if plan not in self._finders:
                self._finders[plan] = _Finder(self._unique[plan])
            poses[rows] = self._finders[plan].places(angles[rows])
        return heads, poses

    def _heads_of(self, table: pa.Table | pa.RecordBatch) -> np.ndarray:
        subjects, expressions = (table.column(name).dictionary_encode() for name in ("subject", "expression"))
        if isinstance(subjects, pa.ChunkedArray):
            subjects, expressions = subjects.combine_chunks(), expressions.combine_chunks()
        index = np.array(
            [
                [
                    self._head_index.get((subject, expression), -1)
                    for expression in expressions.dictionary.to_pylist()
                ]
                for subject in subjects.dictionary.to_pylist()
            ],
            np.int32,
        ).reshape(len(subjects.dictionary), len(expressions.dictionary))
        return index[subjects.indices.to_numpy(), expressions.indices.to_numpy()]

    @cached_property
    def _all_angles(self) -> np.ndarray:
        return np.concatenate([plan.angles_deg for plan in self._unique])

    @cached_property
    def _all_indices(self) -> np.ndarray:
        return np.concatenate([plan.indices for plan in self._unique])


class _Finder:
    """The place of a pose in one plan, by its place on each axis, so that only whole numbers are compared."""

    def __init__(self, plan: PosePlan) -> None:
        self._axes = [np.unique(axis) for axis in plan.angles_deg.T]
        keys = self._keys(plan.angles_deg)
        self._order = np.argsort(keys)
        self._sorted = keys[self._order]

    def places(self, angles: np.ndarray) -> np.ndarray:
        """float [N, 3] -> int32 [N], -1 where the plan has no such pose."""
        keys = self._keys(angles)
        at = np.minimum(np.searchsorted(self._sorted, keys), len(self._sorted) - 1)
        return np.where(self._sorted[at] == keys, self._order[at], -1).astype(np.int32)

    def _keys(self, angles: np.ndarray) -> np.ndarray:
        """int64 [N], one number a pose, -1 where an angle is not one of the plan's."""
        keys = np.zeros(len(angles), np.int64)
        known = np.ones(len(angles), bool)
        for values, angle in zip(self._axes, angles.T, strict=True):
            at = np.minimum(np.searchsorted(values, angle), len(values) - 1)
            known &= values[at] == angle
            keys = keys * len(values) + at
        return np.where(known, keys, -1)


def read_dataset_poses(root: Path, heads: Sequence[HeadRow]) -> DatasetPoses:
    """The poses of a dataset. Raises DatasetError: poses.csv is missing, damaged, or lacks a head."""
    return DatasetPoses(heads, read_pose_plans(dataset_file(root, POSES_FILE)))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the detector finds the face: counted over heads x poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.dataset.format.manifest import POSES_FILE, Manifest
from generator.dataset.format.open import as_array, read_rows
from generator.plan.poses import ANGLES, PosePlan, csv_plan

BIN_DEG = 10
MAX_CELLS = 30
"""A grid with more values than this on an axis is binned too: nobody reads a larger map."""


@dataclass(frozen=True)
class Cell:
    """Detection at one yaw and pitch, over all rolls and heads."""

    yaw_deg: float
    pitch_deg: float
    rows: int
    detected: int

    @property
    def rate(self) -> float:
        """Share of rows with a face found."""
        return self.detected / self.rows


class Places:
    """Finds rows in heads.parquet and poses.csv, many at a time: there may be millions of rows."""

    def __init__(self, heads: Sequence[HeadRow], plan: PosePlan) -> None:
        self._head_index = {(head.subject, head.expression): i for i, head in enumerate(heads)}
        # A pose is found by its place on each axis, so that only whole numbers are compared.
        self._axes = [np.unique(axis) for axis in plan.angles_deg.T]
        keys = self._keys(plan.angles_deg)
        self._order = np.argsort(keys)
        self._sorted = keys[self._order]

    def of(self, table: pa.Table | pa.RecordBatch) -> tuple[np.ndarray, np.ndarray]:
        """int32 [N]: the head and the pose of each row, -1 where unknown."""
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
        heads = index[subjects.indices.to_numpy(), expressions.indices.to_numpy()]
        keys = self._keys(np.stack([as_array(table, f"{name}_deg") for name in ANGLES], axis=-1))
        at = np.minimum(np.searchsorted(self._sorted, keys), len(self._sorted) - 1)
        poses = np.where(self._sorted[at] == keys, self._order[at], -1).astype(np.int32)
        return heads, poses

    def _keys(self, angles: np.ndarray) -> np.ndarray:
        """int64 [N], one number a pose, -1 where an angle is not one of the plan's."""
        keys = np.zeros(len(angles), np.int64)
        known = np.ones(len(angles), bool)
        for values, angle in zip(self._axes, angles.T, strict=True):
            at = np.minimum(np.searchsorted(values, angle), len(values) - 1)
            known &= values[at] == angle
            keys = keys * len(values) + at
        return np.where(known, keys, -1)


class DetectionTally:
    """How often each (head, pose) was seen and whether its face was found.

    Two bytes a row and nothing else, so millions of rows fit.
    rows, detected: uint8 [heads, poses].
    """

    def __init__(self, heads: Sequence[HeadRow], plan: PosePlan) -> None:
        self.heads, self.plan = heads, plan
        self.rows = np.zeros((len(heads), len(plan)), np.uint8)
        self.detected = np.zeros((len(heads), len(plan)), np.uint8)

    def add(self, heads: np.ndarray, poses: np.ndarray, detected: np.ndarray) -> None:
        """Count rows by their places, int [N], none below 0; detected: bool [N]."""
        np.add.at(self.rows, (heads, poses), 1)
        np.add.at(self.detected, (heads, poses), detected.astype(np.uint8))

    @property
    def rate(self) -> float:
        """Share of rows with a face found; NaN without rows."""
        return _rate(self.detected, self.rows)

    def by_subject(self) -> dict[str, float]:
        """Detection rate of each subject that has rows, over expressions and poses."""
        places: dict[str, list[int]] = {}
        for place, head in enumerate(self.heads):
            places.setdefault(head.subject, []).append(place)
        rates = {subject: _rate(self.detected[at], self.rows[at]) for subject, at in places.items()}
        return {subject: rate for subject, rate in rates.items() if rate == rate}

    def by_cell(self) -> list[Cell]:
        """Detection over yaw x pitch, sorted; cells of 10° where the poses are off the grid."""
        angles = self.plan.angles_deg[:, :2]
        if (self.plan.indices < 0).any() or max(len(np.unique(axis)) for axis in angles.T) > MAX_CELLS:
            angles = np.round(angles / BIN_DEG) * BIN_DEG + 0.0
        cells, cell_of_pose = np.unique(angles, axis=0, return_inverse=True)
        rows = np.bincount(cell_of_pose.ravel(), self.rows.sum(axis=0), len(cells)).astype(int)
        detected = np.bincount(cell_of_pose.ravel(), self.detected.sum(axis=0), len(cells)).astype(int)
        return [
            Cell(yaw, pitch, n, k)
            for (yaw, pitch), n, k in zip(cells.tolist(), rows.tolist(), detected.tolist(), strict=True)
            if n
        ]


def tally_detection(root: Path, manifest: Manifest) -> DetectionTally:
    """Count a finished dataset. Raises DatasetError or UsageError if one of its files cannot be read."""
    heads, plan = read_heads(root), csv_plan(root / POSES_FILE)
    tally, places = DetectionTally(heads, plan), Places(heads, plan)
    columns = ["subject", "expression", *(f"{name}_deg" for name in ANGLES), "detected"]
    for batch in read_rows(root, manifest.parts, columns):
        head, pose = places.of(batch)
        known = (head >= 0) & (pose >= 0)
        tally.add(head[known], pose[known], as_array(batch, "detected")[known])
    return tally


def _rate(detected: np.ndarray, rows: np.ndarray) -> float:
    total = int(rows.sum(dtype=np.int64))
    return int(detected.sum(dtype=np.int64)) / total if total else float("nan")

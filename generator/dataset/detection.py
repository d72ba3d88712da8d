# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the detector finds the face: counted over heads x poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.heads_table import HeadRow, read_heads
from generator.dataset.manifest import POSES_FILE, Manifest
from generator.dataset.open import as_array, read_rows
from generator.plan.poses import PosePlan, csv_plan

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


class DetectionTally:
    """How often each (head, pose) was seen and whether its face was found.

    Two bytes a row and nothing else, so millions of rows fit.
    rows, detected: uint8 [heads, poses].
    """

    def __init__(self, heads: Sequence[HeadRow], plan: PosePlan) -> None:
        self.heads, self.plan = heads, plan
        self.rows = np.zeros((len(heads), len(plan)), np.uint8)
        self.detected = np.zeros((len(heads), len(plan)), np.uint8)
        self._head_index = {(head.subject, head.expression): i for i, head in enumerate(heads)}
        self._pose_index = {tuple(pose): i for i, pose in enumerate(plan.angles_deg.tolist())}

    def add(self, table: pa.Table | pa.RecordBatch) -> tuple[np.ndarray, np.ndarray]:
        """Count rows; returns the places int64 [N] of their heads and poses, -1 where unknown."""
        names = zip(*(table.column(name).to_pylist() for name in ("subject", "expression")), strict=True)
        angles = zip(
            *(as_array(table, f"{name}_deg").tolist() for name in ("yaw", "pitch", "roll")), strict=True
        )
        heads = np.array([self._head_index.get(name, -1) for name in names], np.int64)
        poses = np.array([self._pose_index.get(angle, -1) for angle in angles], np.int64)
        known = (heads >= 0) & (poses >= 0)
        place = (heads[known], poses[known])
        np.add.at(self.rows, place, 1)
        np.add.at(self.detected, place, as_array(table, "detected")[known].astype(np.uint8))
        return heads, poses

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
    tally = DetectionTally(read_heads(root), csv_plan(root / POSES_FILE))
    columns = ["subject", "expression", "yaw_deg", "pitch_deg", "roll_deg", "detected"]
    for batch in read_rows(root, manifest.parts, columns):
        tally.add(batch)
    return tally


def _rate(detected: np.ndarray, rows: np.ndarray) -> float:
    total = int(rows.sum(dtype=np.int64))
    return int(detected.sum(dtype=np.int64)) / total if total else float("nan")

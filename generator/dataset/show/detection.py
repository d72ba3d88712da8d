# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the detector finds the face: counted over heads x poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generator.dataset.format.dataset_poses import DatasetPoses, read_dataset_poses
from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import as_array, read_rows
from generator.errors import DatasetError
from generator.limits import MAX_ROWS
from generator.plan.poses import ANGLES

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
    rows, detected: uint8 [heads, poses]; of a head with fewer poses the last are never counted.
    Raises DatasetError: there would be more than MAX_ROWS of them.
    """

    def __init__(self, heads: Sequence[HeadRow], poses: DatasetPoses) -> None:
        self.heads, self.poses = heads, poses
        if len(heads) * poses.most > MAX_ROWS:
            raise DatasetError(
                f"{len(heads):,} heads with up to {poses.most:,} poses are more than are counted"
            )
        self.rows = np.zeros((len(heads), poses.most), np.uint8)
        self.detected = np.zeros((len(heads), poses.most), np.uint8)

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
        every, starts = self.poses.flat_angles()
        angles = every[:, :2]
        if not self.poses.on_grid or max(len(np.unique(axis)) for axis in angles.T) > MAX_CELLS:
            angles = np.round(angles / BIN_DEG) * BIN_DEG + 0.0
        cells, cell_of_pose = np.unique(angles, axis=0, return_inverse=True)
        # Heads that share a plan are counted together.
        totals = np.zeros((2, len(every)), np.int64)
        for start in np.unique(starts).tolist():
            same = starts == start
            for total, counted in zip(totals, (self.rows, self.detected), strict=True):
                count = int(self.poses.counts[same][0])
                total[start : start + count] = counted[same, :count].sum(axis=0)
        rows, detected = (np.bincount(cell_of_pose.ravel(), t, len(cells)).astype(int) for t in totals)
        return [
            Cell(yaw, pitch, n, k)
            for (yaw, pitch), n, k in zip(cells.tolist(), rows.tolist(), detected.tolist(), strict=True)
            if n
        ]


def tally_detection(root: Path, manifest: Manifest) -> DetectionTally:
    """Count a finished dataset. Raises DatasetError if one of its files cannot be read."""
    heads = read_heads(root)
    poses = read_dataset_poses(root, heads)
    tally = DetectionTally(heads, poses)
    columns = ["subject", "expression", *(f"{name}_deg" for name in ANGLES), "detected"]
    for batch in read_rows(root, manifest.parts, columns):
        head, pose = poses.of(batch)
        known = (head >= 0) & (pose >= 0)
        tally.add(head[known], pose[known], as_array(batch, "detected")[known])
    return tally


def _rate(detected: np.ndarray, rows: np.ndarray) -> float:
    total = int(rows.sum(dtype=np.int64))
    return int(detected.sum(dtype=np.int64)) / total if total else float("nan")

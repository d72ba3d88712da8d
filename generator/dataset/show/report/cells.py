# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses sorted into cells of yaw x pitch x roll."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.show.detection import BIN_DEG, MAX_CELLS


@dataclass(frozen=True, eq=False)
class PoseCells:
    """axes: the centres along yaw, pitch and roll, float64, ascending. binned: 10° wide, not grid values."""

    axes: tuple[np.ndarray, np.ndarray, np.ndarray]
    binned: bool

    @classmethod
    def of(cls, poses: DatasetPoses) -> PoseCells:
        """The grid's own values; cells of 10° where poses are off the grid or the grid is too fine."""
        angles, _ = poses.flat_angles()
        binned = not poses.on_grid or max(len(np.unique(axis)) for axis in angles.T) > MAX_CELLS
        if binned:
            angles = _round(angles)
        yaw, pitch, roll = (np.unique(axis) for axis in angles.T)
        return cls((yaw, pitch, roll), binned)

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along yaw, pitch and roll."""
        return tuple(len(axis) for axis in self.axes)

    def place(self, angles_deg: np.ndarray) -> np.ndarray:
        """The cell of each pose. float [N, 3] -> int64 [N], row-major over (yaw, pitch, roll)."""
        angles = _round(angles_deg) if self.binned else angles_deg
        places = [
            np.clip(np.searchsorted(axis, values), 0, len(axis) - 1)
            for axis, values in zip(self.axes, angles.T, strict=True)
        ]
        return np.ravel_multi_index(places, self.shape)


def _round(angles_deg: np.ndarray) -> np.ndarray:
    return np.round(angles_deg / BIN_DEG) * BIN_DEG + 0.0

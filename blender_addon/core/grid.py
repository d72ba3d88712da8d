# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan behind the timeline: frame k shows pose k - 1."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from generator.errors import UsageError
from generator.plan.poses import PosePlan, csv_plan, grid_plan, uniform_plan

RANGES = ("yaw", "pitch", "roll")


def plan_poses(poses: dict[str, Any]) -> PosePlan:
    """The plan of a [poses] table; the last few are kept.

    Raises UsageError if it makes no sense, or needs the host (Sobol sequences).
    """
    path = poses.get("path") or ""
    stamp = Path(path).stat().st_mtime_ns if path and Path(path).is_file() else 0
    ranges = tuple(tuple(poses[name]) for name in RANGES)
    return _plan(poses["kind"], ranges, int(poses["count"]), int(poses["seed"]), path, stamp)


@lru_cache(maxsize=8)
def _plan(
    kind: str, ranges: tuple[tuple[float, ...], ...], count: int, seed: int, path: str, stamp: int
) -> PosePlan:
    if kind == "grid":
        return grid_plan(*ranges)
    if kind == "uniform":
        return uniform_plan(count, seed, *(axis[:2] for axis in ranges))
    if kind == "csv":
        if not path:
            raise UsageError("choose the CSV file of the poses")
        return csv_plan(Path(path))
    raise UsageError("Sobol poses are drawn when the dataset is built: they are not on the timeline")


def snapped(angle: float, axis: Sequence[float]) -> float:
    """The value of a grid axis (start, stop, step) nearest to angle, degrees."""
    start, stop, step = axis
    steps = round((min(max(angle, start), stop) - start) / step)
    return min(start + steps * step, stop)


def extremes(poses: dict[str, Any]) -> list[tuple[float, float, float]]:
    """Nine poses for a contact sheet: the ends of yaw and pitch and zero between them, corners rolled."""
    yaw, pitch, roll = (poses[name] for name in RANGES)
    rows = []
    for p in (pitch[1], 0.0, pitch[0]):
        for y in (yaw[0], 0.0, yaw[1]):
            corner = (p != 0) and (y != 0)
            r = 0.0 if not corner else (roll[1] if (y > 0) == (p > 0) else roll[0])
            rows.append((float(y), float(p), float(r)))
    return rows

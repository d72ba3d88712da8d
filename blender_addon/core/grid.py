# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan behind the timeline: frame k shows pose k - 1."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from generator.errors import UsageError
from generator.plan.poses import OFF_GRID, PosePlan, csv_plan, grid_plan, uniform_plan

RANGES = ("yaw", "pitch", "roll")


_drawn: dict[Any, PosePlan] = {}


class NotDrawn(UsageError):
    """A Sobol plan that the host has not drawn yet: it takes SciPy, which Blender lacks."""


def plan_poses(poses: dict[str, Any]) -> PosePlan:
    """The plan of a [poses] table; the last few are kept.

    Raises UsageError if it makes no sense, NotDrawn if the host has to draw it first.
    """
    key = _key(poses)
    return _drawn[key] if key in _drawn else _plan(*key)


def remember(poses: dict[str, Any], file: Path) -> None:
    """Take what the host drew for a [poses] table: float64 [N, 3] in an .npy file, degrees."""
    angles = np.load(file)
    _drawn.clear()
    _drawn[_key(poses)] = PosePlan(angles, np.full(angles.shape, OFF_GRID, dtype=np.int16), poses["kind"])


def _key(poses: dict[str, Any]) -> tuple[Any, ...]:
    path = poses.get("path") or ""
    stamp = Path(path).stat().st_mtime_ns if path and Path(path).is_file() else 0
    ranges = tuple(tuple(poses[name]) for name in RANGES)
    return poses["kind"], ranges, int(poses["count"]), int(poses["seed"]), path, stamp


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
    raise NotDrawn("the host has not drawn these poses yet")


def snapped(angle: float, axis: Sequence[float]) -> float:
    """The value of a grid axis (start, stop, step) nearest to angle, degrees."""
    start, stop, step = axis
    steps = round((min(max(angle, start), stop) - start) / step)
    return min(start + steps * step, stop)


def extremes(poses: dict[str, Any]) -> list[tuple[float, float, float]]:
    """Nine poses for a contact sheet: the ends of yaw and pitch and zero between them, corners rolled."""
    if poses["kind"] == "csv":
        angles = plan_poses(poses).angles_deg
        ends = list(zip(angles.min(axis=0).tolist(), angles.max(axis=0).tolist(), strict=True))
    else:
        ends = [tuple(map(float, poses[name][:2])) for name in RANGES]
    yaw, pitch, roll = ((low, min(max(0.0, low), high), high) for low, high in ends)
    rows = []
    for down, p in enumerate(reversed(pitch)):
        for across, y in enumerate(yaw):
            side = (across - 1) * (1 - down)  # 0 but for the corners
            rows.append((y, p, roll[1 + side]))
    return rows

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan behind the timeline: frame k shows pose k - 1."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.errors import UsageError
from generator.plan.poses import ANGLES, PosePlan, csv_plan, grid_plan, plan_of, uniform_plan
from generator.plan.settings import Poses

KEPT = 64
"""So many plans that the host drew are remembered."""

HeadName = tuple[str, str]
"""(subject, expression)."""

_drawn: dict[tuple[Poses, HeadName | None], PosePlan] = {}


class NotDrawn(UsageError):
    """A plan that the host has not drawn yet: it is a head's own, or takes SciPy, which Blender lacks."""


def plan_poses(poses: Poses, head: HeadName) -> PosePlan:
    """The poses of a head; the last few plans are kept. poses: with an absolute path.

    Raises UsageError if it makes no sense, NotDrawn if the host has to draw it first.
    """
    if poses.kind != "sobol":
        path = Path(poses.path or "")
        plan = _plan(poses, path.stat().st_mtime_ns if poses.path and path.is_file() else 0)
        if not has_own(poses):
            return plan
    if (drawn := _drawn.get(_key(poses, head))) is None:
        raise NotDrawn("the host has not drawn these poses yet")
    return drawn


def has_own(poses: Poses) -> bool:
    """Has each head poses of its own?"""
    return poses.kind not in ("grid", "csv") and not poses.same


def remember(poses: Poses, head: HeadName, file: Path) -> None:
    """Take what the host drew for a head: float64 [N, 3] in an .npy file, degrees."""
    angles = np.load(file)
    while len(_drawn) >= KEPT:
        del _drawn[next(iter(_drawn))]
    _drawn[_key(poses, head)], _ = plan_of(angles, np.full(angles.shape, -1), poses.kind)


def _key(poses: Poses, head: HeadName) -> tuple[Poses, HeadName | None]:
    return poses, None if poses.same else head


@lru_cache(maxsize=8)
def _plan(poses: Poses, stamp: int) -> PosePlan:
    ranges = [getattr(poses, angle) for angle in ANGLES]
    if poses.kind == "grid":
        return grid_plan(*ranges)
    if poses.kind == "csv":
        if not poses.path:
            raise UsageError("choose the CSV file of the poses")
        return csv_plan(Path(poses.path))
    # The default serves grids as well; a step that a file names is a misunderstanding.
    ends = [r[:2] if r == getattr(Poses, angle) else r for angle, r in zip(ANGLES, ranges, strict=True)]
    return uniform_plan(poses.count, poses.seed, *ends)


def snapped(angle: float, axis: Sequence[float]) -> float:
    """The value of a grid axis (start, stop, step) nearest to angle, degrees."""
    start, stop, step = axis
    steps = round((min(max(angle, start), stop) - start) / step)
    return min(start + steps * step, stop)


def extremes(poses: Poses) -> list[tuple[float, float, float]]:
    """Nine poses for a contact sheet: the ends of yaw and pitch and zero between them, corners rolled."""
    ends = np.array([getattr(poses, angle)[:2] for angle in ANGLES], dtype=np.float64).T
    if poses.kind == "csv":
        angles = plan_poses(poses, ("", "")).angles_deg
        ends = np.array([angles.min(axis=0), angles.max(axis=0)])
    yaw, pitch, roll = ((low, min(max(0.0, low), high), high) for low, high in ends.T.tolist())
    rows = []
    for down, p in enumerate(reversed(pitch)):
        for across, y in enumerate(yaw):
            side = (across - 1) * (1 - down)  # 0 but for the corners
            rows.append((y, p, roll[1 + side]))
    return rows

# SPDX-License-Identifier: GPL-3.0-or-later
"""The poses of every head of a dataset: one plan for all heads, or a draw of its own for each."""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from generator.errors import DatasetError, UsageError
from generator.limits import MAX_ROWS
from generator.names import as_name
from generator.plan.config import BuildConfig
from generator.plan.draws import Seed, draw_seed
from generator.plan.poses import (
    ANGLES,
    MAX_CSV_BYTES,
    PosePlan,
    csv_plan,
    grid_plan,
    plan_of,
    sobol_plan,
    uniform_plan,
)
from generator.plan.settings import Poses
from generator.reading import read_text

HeadName = tuple[str, str]
"""(subject, expression)."""

POSES_FILE = "poses.csv"
CHUNK = "chunk"
_DRAWN = {"uniform": uniform_plan, "sobol": sobol_plan}
_HEAD = ("subject", "expression")
_COLUMNS = tuple(f"{angle}_{what}" for what in ("deg", "index") for angle in ANGLES)


@dataclass(frozen=True, eq=False)
class PosePlans:
    """The plan of each head. shared: of all heads; None where each has its own.

    chunks: which poses are built together, int64 [N], of the shared plan under None, else of each head;
    empty where nobody said.
    """

    shared: PosePlan | None
    by_head: Mapping[HeadName, PosePlan] = field(default_factory=dict)
    chunks: Mapping[HeadName | None, np.ndarray] = field(default_factory=dict)

    def of(self, subject: str, expression: str) -> PosePlan:
        """The poses of a head. KeyError if it has none."""
        return self.by_head[subject, expression] if self.shared is None else self.shared

    def chunks_of(self, subject: str, expression: str) -> np.ndarray | None:
        """Which of a head's poses are built together; None where nobody said."""
        return self.chunks.get(None if self.shared is not None else (subject, expression))

    @property
    def plans(self) -> list[PosePlan]:
        """Each plan once."""
        return [self.shared] if self.shared is not None else list(self.by_head.values())

    def count(self, heads: Iterable[HeadName]) -> int:
        """Rows of some heads."""
        return sum(len(self.of(*head)) for head in heads)


def is_drawn(poses: Poses) -> bool:
    """Are the poses random?"""
    return poses.kind in _DRAWN


def plan_poses(config: BuildConfig, heads: Iterable[HeadName]) -> PosePlans:
    """The poses that a configuration asks for. UsageError if they make no sense."""
    poses, names = config.poses, list(heads)
    if not is_drawn(poses) or poses.same:
        plan = shared_plan(config)
        _check_rows(len(plan) * len(names))
        return PosePlans(plan)
    _check_rows(poses.count * len(names))
    return PosePlans(None, {head: _draw(poses, draw_seed(poses.seed, "poses", *head)) for head in names})


def _check_rows(rows: int) -> None:
    if rows > MAX_ROWS:
        raise UsageError(f"{rows:,} rows, more than {MAX_ROWS:,}; use fewer heads or poses")


def shared_plan(config: BuildConfig) -> PosePlan:
    """One plan for all heads: of a grid, a table, or the same draw. UsageError if it makes no sense."""
    poses = config.poses
    if poses.kind == "csv":
        if poses.path is None:
            raise UsageError("poses.path: a CSV pose plan needs the path of its file")
        return csv_plan(config.located(poses.path))
    if poses.kind in _DRAWN:
        return _draw(poses, poses.seed)
    return grid_plan(poses.yaw, poses.pitch, poses.roll)


def _draw(poses: Poses, seed: Seed) -> PosePlan:
    ranges = {}
    for name in ANGLES:
        axis = getattr(poses, name)
        # The default serves both kinds; a step that somebody gave is a misunderstanding.
        ranges[name] = axis[:2] if axis == getattr(Poses, name) else axis
    return _DRAWN[poses.kind](poses.count, seed, **ranges)


def poses_csv(plans: PosePlans) -> str:
    """The text of poses.csv: the head where each has its own poses, the pose, and its chunk if it has one.

    Every number is written so that it is read back bit by bit, and every name as it is: this file is for
    programs, and a name holds no sign that a formula could do harm with.
    """
    heads: Iterable[HeadName | None] = [None] if plans.shared is not None else sorted(plans.by_head)
    names = [*(_HEAD if plans.shared is None else ()), *_COLUMNS, *([CHUNK] if plans.chunks else [])]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for head in heads:
        plan = plans.shared if head is None else plans.by_head[head]
        assert plan is not None, "a plan is shared, or its head has it"
        columns = [*plan.angles_deg.T.tolist(), *plan.indices.T.tolist()]
        if plans.chunks:
            columns.append(plans.chunks[head].tolist())
        before = [] if head is None else list(head)
        writer.writerows([*before, *map(repr, row)] for row in zip(*columns, strict=True))
    return text.getvalue()


def read_pose_plans(file: Path) -> PosePlans:
    """The inverse of :func:`poses_csv`. Raises DatasetError if it is not such a file."""
    rows: dict[HeadName | None, list[tuple[list[float], list[int], int]]] = defaultdict(list)
    try:
        reader = csv.reader(io.StringIO(read_text(file, MAX_CSV_BYTES), newline=""))
        names = next(reader)
        at = {name: place for place, name in enumerate(names)}
        own, chunked = _HEAD[0] in at, CHUNK in at
        angles, indices = ([at[f"{a}_{what}"] for a in ANGLES] for what in ("deg", "index"))
        for row in reader:
            head = (as_name(row[at["subject"]]), as_name(row[at["expression"]])) if own else None
            chunk = int(row[at[CHUNK]]) if chunked else -1
            rows[head].append(([float(row[k]) for k in angles], [int(row[k]) for k in indices], chunk))
        if not rows:
            raise ValueError("it has no rows")
        return _plans(rows, own, chunked)
    except (OSError, ValueError, ArithmeticError, KeyError, IndexError, StopIteration, csv.Error) as error:
        raise DatasetError(
            f"{file}: not the poses of an earlier build ({error}); build again with --fresh"
        ) from error


def _plans(
    rows: Mapping[HeadName | None, list[tuple[list[float], list[int], int]]], own: bool, chunked: bool
) -> PosePlans:
    plans: dict[HeadName | None, PosePlan] = {}
    chunks: dict[HeadName | None, np.ndarray] = {}
    for head, found in rows.items():
        angles, indices, numbers = (np.array(column) for column in zip(*found, strict=True))
        if not np.isfinite(angles).all() or len(np.unique(angles, axis=0)) < len(angles):
            raise ValueError("a pose is not finite, or there twice")
        plans[head], order = plan_of(angles, indices)
        if chunked:
            chunks[head] = numbers[order].astype(np.int64)
    if own:
        return PosePlans(None, {head: plan for head, plan in plans.items() if head is not None}, chunks)
    return PosePlans(plans[None], {}, chunks)

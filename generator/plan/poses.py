# SPDX-License-Identifier: GPL-3.0-or-later
"""Pose plans: which (yaw, pitch, roll) every head is rendered at."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np

from generator.errors import UsageError
from generator.limits import MAX_POSES
from generator.plan.draws import Seed
from generator.reading import check_regular

ANGLES = ("yaw", "pitch", "roll")
OFF_GRID = -1
DRAWN_DECIMALS = 4
"""Random angles are rounded when they are drawn, so that a short label is the exact value."""

MAX_CSV_BYTES = 1 << 30
_MAX_INDEX = np.iinfo(np.int16).max


@dataclass(frozen=True, eq=False)
class PosePlan:
    """The poses of a head.

    angles_deg: float64 [N, 3], (yaw, pitch, roll) in degrees, sorted
        lexicographically, no pose twice.
    indices: int16 [N, 3], place in the grid along each axis, -1 off the grid.
    kind: "grid", "uniform", "sobol" or "csv".
    """

    angles_deg: np.ndarray
    indices: np.ndarray
    kind: str

    def __len__(self) -> int:
        return len(self.angles_deg)


def grid_plan(
    yaw: Sequence[float] = (-50, 50, 10),
    pitch: Sequence[float] = (-40, 40, 10),
    roll: Sequence[float] = (-30, 30, 10),
) -> PosePlan:
    """Every combination of start, start + step ... stop. 693 poses by default.

    Each axis is (start, stop, step) in degrees; both ends belong to the grid.
    Values are computed in decimal, so a step of 0.1 gives 0.3 and not 0.30000000000000004.

    Raises
    ------
    UsageError: the step does not divide its range, or a limit is out of bounds.
    """
    for name, axis in zip(ANGLES, (yaw, pitch, roll), strict=True):
        if len(axis) != 3:
            raise UsageError(f"poses.{name}: a grid needs start, stop and step, got {list(axis)}")
    axes = [_axis(name, *axis) for name, axis in zip(ANGLES, (yaw, pitch, roll), strict=True)]
    count = math.prod(len(axis) for axis in axes)
    if count > MAX_POSES:
        raise UsageError(f"the grid has {count:,} poses, more than {MAX_POSES:,}; use a larger step")
    angles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = [np.arange(len(axis)) for axis in axes]
    indices = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return _plan(angles, indices, "grid")


def uniform_plan(
    count: int,
    seed: Seed,
    yaw: Sequence[float] = (-50, 50),
    pitch: Sequence[float] = (-40, 40),
    roll: Sequence[float] = (-30, 30),
) -> PosePlan:
    """count independent poses, uniform in each angle, rounded to 4 decimals.

    Raises UsageError: count < 1, a limit out of bounds, or a range too narrow for count poses.
    """
    rng = np.random.default_rng(seed)
    drawn = np.empty((0, 3))

    def more() -> np.ndarray:
        nonlocal drawn
        drawn = np.concatenate([drawn, rng.random((count, 3))])
        return drawn

    return _random_plan(more, count, (yaw, pitch, roll), "uniform")


def sobol_plan(
    count: int,
    seed: Seed,
    yaw: Sequence[float] = (-50, 50),
    pitch: Sequence[float] = (-40, 40),
    roll: Sequence[float] = (-30, 30),
) -> PosePlan:
    """count poses of a scrambled Sobol sequence: random, but evenly spread. Rounded to 4 decimals.

    Owen, "Scrambling Sobol' and Niederreiter-Xing points", J. Complexity 14(4), 1998.
    Raises UsageError as :func:`uniform_plan` does.
    """
    from scipy.stats import qmc

    power = max(count - 1, 0).bit_length() - 1

    def more() -> np.ndarray:
        # A scrambled sequence of 2^(m+1) points starts with that of 2^m points.
        nonlocal power
        power += 1
        return qmc.Sobol(d=3, scramble=True, rng=np.random.default_rng(seed)).random_base2(power)

    return _random_plan(more, count, (yaw, pitch, roll), "sobol")


def csv_plan(path: Path) -> PosePlan:
    """The poses of a CSV file, exactly as written, sorted.

    Columns yaw_deg, pitch_deg, roll_deg (or yaw, pitch, roll), found by the
    header; yaw_index, pitch_index, roll_index are read where all three are there;
    other columns are ignored.

    Raises
    ------
    UsageError: no such file, no header, no rows, a cell that is not a finite
        number, a limit out of bounds, or a pose twice; with the line number.
    """
    path = Path(path)
    try:
        check_regular(path, MAX_CSV_BYTES)
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            angle_columns, index_columns = _csv_columns(path, reader.fieldnames)
            rows: dict[tuple[float, ...], tuple[int, list[int]]] = {}
            for row in reader:
                where = f"{path}, line {reader.line_num}"
                if None in row:
                    cells = len(row) - 1 + len(row[None])
                    raise UsageError(f"{where}: {cells} cells, the header has {len(row) - 1}")
                angles = tuple(_angle(where, name, row[name]) for name in angle_columns)
                for name, angle in zip(ANGLES, angles, strict=True):
                    _check_limit(name, angle, f"{where}: ")
                if len(rows) >= MAX_POSES:
                    raise UsageError(f"{where}: more than {MAX_POSES:,} poses; take some out")
                if angles in rows:
                    raise UsageError(f"{where}: the pose of line {rows[angles][0]} again; remove one of them")
                indices = [_index(where, name, row[name]) for name in index_columns]
                rows[angles] = (reader.line_num, indices or [OFF_GRID] * 3)
    except (OSError, ValueError, csv.Error) as error:
        raise UsageError(f"{path}: cannot be read as a CSV file of poses: {error}") from error
    if not rows:
        raise UsageError(f"{path}: no poses below the header; add at least one row")
    return _plan(np.array(list(rows)), np.array([indices for _, indices in rows.values()]), "csv")


def pose_name(yaw: float, pitch: float, roll: float) -> str:
    """A name for files and labels, such as "y+10_p-20.5_r+0": exact, so unique to the pose."""
    parts = (f"{float(angle) + 0.0:+}".removesuffix(".0") for angle in (yaw, pitch, roll))
    return "_".join(letter + part for letter, part in zip("ypr", parts, strict=True))


def plan_of(angles: np.ndarray, indices: np.ndarray, kind: str = "csv") -> tuple[PosePlan, np.ndarray]:
    """A plan of poses in any order, none twice, and the order into which it put them, int64 [N]."""
    angles = angles.astype(np.float64) + 0.0  # turns -0.0 into 0.0: one pose, one name
    order = np.lexsort(angles.T[::-1])
    angles, indices = angles[order], indices.astype(np.int16)[order]
    angles.flags.writeable = indices.flags.writeable = False
    return PosePlan(angles, indices, kind), order


def _plan(angles: np.ndarray, indices: np.ndarray, kind: str) -> PosePlan:
    return plan_of(angles, indices, kind)[0]


def _axis(name: str, start: float, stop: float, step: float) -> np.ndarray:
    _check_range(name, start, stop)
    if not (math.isfinite(step) and step > 0):
        raise UsageError(f"{name}: the step is {step:g}, expected a number of degrees above 0")
    if (stop - start) / step > _MAX_INDEX:  # also where there are more than a Decimal has digits
        raise UsageError(
            f"{name}: a step of {step:g} gives more than {_MAX_INDEX + 1} values; use a larger step"
        )
    first, last, width = (Decimal(repr(float(value))) for value in (start, stop, step))
    steps, rest = divmod(last - first, width)
    if rest:
        fits = " or ".join(f"{float(value):g}" for value in _steps_that_fit(last - first, width))
        raise UsageError(
            f"{name}: a step of {step:g} does not divide the range from {start:g} to {stop:g}; "
            f"use a step of {fits}, or stop at {float(last - rest):g}"
        )
    return np.array([float(first + k * width) for k in range(int(steps) + 1)])


def _steps_that_fit(span: Decimal, step: Decimal) -> list[Decimal]:
    """The next smaller and the next larger step that divide span, in no more digits than given."""
    unit = Decimal(1).scaleb(min(int(value.as_tuple().exponent) for value in (span, step)))
    units = int(span / unit)
    count = max(units // int(step / unit), 1)
    coarse = next(k for k in range(count, 0, -1) if units % k == 0)
    fine = next((k for k in range(count + 1, min(units, _MAX_INDEX) + 1) if units % k == 0), coarse)
    return [unit * (units // k) for k in sorted({coarse, fine}, reverse=True)]


def _check_range(name: str, start: float, stop: float) -> None:
    _check_limit(name, start)
    _check_limit(name, stop)
    if start > stop:
        raise UsageError(f"{name}: starts at {start:g} above its end {stop:g}; swap the two")


def _check_limit(name: str, angle: float, where: str = "") -> None:
    if name == "yaw" and not -90 < angle < 90:
        raise UsageError(
            f"{where}yaw is {angle:g}, expected between -90 and 90: at ±90 pitch and roll turn about "
            "the same axis (gimbal lock) and no longer have a value of their own"
        )
    if not -180 < angle <= 180:
        raise UsageError(f"{where}{name} is {angle:g}, expected above -180 and at most 180 (-180 is 180)")


def _random_plan(
    more: Callable[[], np.ndarray], count: int, ranges: Sequence[Sequence[float]], kind: str
) -> PosePlan:
    """The first count distinct poses of a growing sequence of points in the unit cube."""
    if count < 1:
        raise UsageError(f"{kind}: {count} poses asked for, expected at least 1")
    if count > MAX_POSES:
        raise UsageError(f"{kind}: {count:,} poses asked for, more than {MAX_POSES:,}")
    for name, axis in zip(ANGLES, ranges, strict=True):
        if len(axis) != 2:
            raise UsageError(f"poses.{name}: a {kind} plan takes low and high, got {list(axis)}")
        _check_range(name, *axis)
    low, high = np.array(ranges, dtype=np.float64).T
    distinct = math.prod(int(n) + 1 for n in np.floor((high - low) * 10**DRAWN_DECIMALS))
    if count > max(distinct // 2, 1):  # close to all of them, drawing would take forever
        raise UsageError(f"{kind}: the ranges are too narrow for {count} different poses; widen them")
    poses = np.empty((0, 3))
    while len(poses) < count:
        drawn = np.clip(np.round(low + (high - low) * more(), DRAWN_DECIMALS), low, high)
        poses = drawn[np.sort(np.unique(drawn, axis=0, return_index=True)[1])]
    return _plan(poses[:count], np.full((count, 3), OFF_GRID), kind)


def _csv_columns(path: Path, header: Iterable[str] | None) -> tuple[list[str], list[str]]:
    if header is None:
        raise UsageError(f"{path}: the file is empty; expected a header yaw_deg,pitch_deg,roll_deg")
    names = set(header)
    for suffix in ("_deg", ""):
        columns = [name + suffix for name in ANGLES]
        if names.issuperset(columns):
            indices = [name + "_index" for name in ANGLES]
            return columns, indices if names.issuperset(indices) else []
    raise UsageError(
        f"{path}: the first line is {','.join(header)!r}, expected a header with the columns "
        "yaw_deg,pitch_deg,roll_deg, separated by commas"
    )


def _angle(where: str, name: str, cell: str | None) -> float:
    try:
        value = float(cell or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(f"{where}: {name} is {cell or ''!r}, expected a finite number of degrees")
    return value


def _index(where: str, name: str, cell: str | None) -> int:
    try:
        value = int(cell or "")
    except ValueError:
        value = OFF_GRID - 1
    if not OFF_GRID <= value <= _MAX_INDEX:
        raise UsageError(f"{where}: {name} is {cell or ''!r}, expected a place in the grid or -1")
    return value

# SPDX-License-Identifier: MIT
"""How far estimators are off: an angle, an interval of an angle, and overall, side by side."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe import escape
from downstream_hpe.errors import DataError
from downstream_hpe.geometry.metrics import axis_errors, euler_errors, geodesic_errors
from downstream_hpe.geometry.rotation import ANGLES, angles_from_rotation, rotation_from_angles

BOUNDS_DEG = (50.0, 40.0, 30.0)
"""The paper's range of yaw, pitch and roll, either side of zero."""
INTERVALS = 6
"""Equal intervals an angle."""


@dataclass(frozen=True)
class Interval:
    """Rows whose true angle lies in [low, high): mean |error| of that angle and mean geodesic error,
    in degrees; NaN where there are none."""

    angle: str
    low: float
    high: float
    count: int
    mae: float
    geodesic: float


@dataclass(frozen=True)
class Evaluation:
    """Errors of one estimator over N rows, degrees.

    mae: of yaw, pitch and roll. maev: mean angle between the rotation's axes. geodesic: mean.
    geodesic_errors: float64 [N], for distributions. predicted_deg: float64 [N, 3], the estimates.
    """

    name: str
    count: int
    mae: tuple[float, float, float]
    maev: float
    geodesic: float
    intervals: tuple[Interval, ...]
    geodesic_errors: np.ndarray
    predicted_deg: np.ndarray

    @property
    def mean_mae(self) -> float:
        """MAE as papers give it: the mean of the three angles'."""
        return float(np.mean(self.mae))


def evaluate(
    name: str,
    predicted_deg: np.ndarray,
    rotation: np.ndarray,
    bounds_deg: Sequence[float] = BOUNDS_DEG,
) -> Evaluation:
    """Compare estimates with the truth.

    Parameters
    ----------
    predicted_deg: float [N, 3], (yaw, pitch, roll). rotation: float [N, 3, 3], the true R_C.
    bounds_deg: the intervals divide [-bound, bound] of each angle into six.

    Raises
    ------
    DataError: no rows, other shapes, or an estimate that is not finite.
    """
    predicted = np.asarray(predicted_deg, dtype=np.float64)
    if not len(predicted) or predicted.shape != (len(rotation), 3):
        raise DataError(
            f"{name}: {predicted.shape} estimates of {len(rotation)} rows; expected [N, 3], N > 0"
        )
    if not np.isfinite(predicted).all():
        raise DataError(f"{name}: an estimate is not finite")
    true = angles_from_rotation(rotation)
    errors = euler_errors(predicted, true)
    turned = rotation_from_angles(predicted)
    geodesic = geodesic_errors(turned, rotation)
    intervals = []
    for k, (angle, bound) in enumerate(zip(ANGLES, bounds_deg, strict=True)):
        edges = np.linspace(-bound, bound, INTERVALS + 1)
        for low, high in pairwise(edges):
            # The last interval is closed: a grid's own bounds belong to it.
            below = true[:, k] < high - 1e-9 if high < bound else true[:, k] <= high + 1e-9
            inside = (true[:, k] >= low - 1e-9) & below
            count = int(inside.sum())
            mae, mean = (errors[inside, k].mean(), geodesic[inside].mean()) if count else (np.nan, np.nan)
            intervals.append(Interval(angle, float(low), float(high), count, float(mae), float(mean)))
    return Evaluation(
        name,
        len(predicted),
        tuple(errors.mean(axis=0).tolist()),
        float(axis_errors(turned, rotation).mean()),
        float(geodesic.mean()),
        tuple(intervals),
        geodesic,
        predicted,
    )


def within_bounds(ypr_deg: np.ndarray, bounds_deg: Sequence[float] = BOUNDS_DEG) -> np.ndarray:
    """Rows with every angle inside its bound: bool [N]."""
    return (np.abs(ypr_deg) <= np.asarray(bounds_deg) + 1e-9).all(axis=1)


def summary(e: Evaluation) -> dict[str, Any]:
    """The overall numbers of one estimator."""
    mae = dict(zip(ANGLES, e.mae, strict=True))
    return {
        "estimator": e.name,
        "rows": e.count,
        **mae,
        "mae": e.mean_mae,
        "maev": e.maev,
        "geodesic": e.geodesic,
    }


def markdown(evaluations: Sequence[Evaluation]) -> str:
    """The overall table, a row an estimator, then mean |error| a true interval."""
    lines = [
        "| estimator | rows | yaw | pitch | roll | MAE | MAEV | geodesic |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for e in evaluations:
        cells = [*e.mae, e.mean_mae, e.maev, e.geodesic]
        lines.append(
            f"| {escape.markdown(e.name)} | {e.count} | "
            + " | ".join(f"{value:.2f}" for value in cells)
            + " |"
        )
    lines += [
        "",
        "| angle | interval | rows | " + " | ".join(escape.markdown(e.name) for e in evaluations) + " |",
        "| --- | --- | ---: | " + " | ".join("---:" for _ in evaluations) + " |",
    ]
    for same in zip(*(e.intervals for e in evaluations), strict=True):
        first = same[0]
        values = " | ".join("-" if not i.count else f"{i.mae:.2f}" for i in same)
        lines.append(f"| {first.angle} | {first.low:.4g} to {first.high:.4g} | {first.count} | {values} |")
    return "\n".join(lines) + "\n"


def write_csv(evaluations: Sequence[Evaluation], path: Path) -> None:
    """One line an estimator and interval, and one with angle "all" an estimator."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["estimator", "angle", "low_deg", "high_deg", "rows", "mae_deg", "maev_deg", "geodesic_deg"]
        )
        for e in evaluations:
            name = escape.csv_text(e.name)
            writer.writerow(
                [name, "all", "", "", e.count, f"{e.mean_mae:.6f}", f"{e.maev:.6f}", f"{e.geodesic:.6f}"]
            )
            for angle, mae in zip(ANGLES, e.mae, strict=True):
                writer.writerow([name, angle, "", "", e.count, f"{mae:.6f}", "", ""])
            for i in e.intervals:
                cells = [f"{i.mae:.6f}", "", f"{i.geodesic:.6f}"] if i.count else ["", "", ""]
                writer.writerow([name, i.angle, f"{i.low:g}", f"{i.high:g}", i.count, *cells])

# SPDX-License-Identifier: MIT
"""How many rows an evaluation had to leave out because no face was found, and at which angles."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from downstream_hpe.evaluation.scores import BOUNDS_DEG, INTERVALS
from downstream_hpe.geometry.rotation import ANGLES


@dataclass(frozen=True)
class Misses:
    """Of the rows whose true angle lies in [low, high): how many there are, and without a face."""

    angle: str
    low: float
    high: float
    count: int
    missed: int


def misses(
    found_deg: np.ndarray, missed_deg: np.ndarray, bounds_deg: Sequence[float] = BOUNDS_DEG
) -> list[Misses]:
    """The intervals of :func:`downstream_hpe.evaluation.scores.evaluate`, the last one closed.

    found_deg: float [N, 3], missed_deg: float [M, 3], (yaw, pitch, roll) of rows with and without a face.
    """
    rows = []
    for k, (angle, bound) in enumerate(zip(ANGLES, bounds_deg, strict=True)):
        for low, high in pairwise(np.linspace(-bound, bound, INTERVALS + 1)):
            edge = high + 1e-9 if high == bound else high - 1e-9
            missed, found = (
                int(((deg[:, k] >= low - 1e-9) & (deg[:, k] < edge)).sum()) for deg in (missed_deg, found_deg)
            )
            rows.append(Misses(angle, float(low), float(high), missed + found, missed))
    return rows


def markdown(rows: Sequence[Misses]) -> str:
    """A line an interval that misses rows."""
    lines = ["| angle | interval | rows | no face found |", "| --- | --- | ---: | ---: |"]
    for r in rows:
        if r.missed:
            share = f"{r.missed} ({r.missed / r.count:.0%})"
            lines.append(f"| {r.angle} | {r.low:.4g} to {r.high:.4g} | {r.count} | {share} |")
    return "\n".join(lines) + "\n"


def write_csv(rows: Sequence[Misses], path: Path) -> None:
    """A line an interval."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["angle", "low_deg", "high_deg", "rows", "no_face_found"])
        writer.writerows([r.angle, f"{r.low:g}", f"{r.high:g}", r.count, r.missed] for r in rows)

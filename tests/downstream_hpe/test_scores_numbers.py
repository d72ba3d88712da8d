# SPDX-License-Identifier: MIT
"""What evaluate prints, to the number: intervals and their ends, misses, protocols, confidence."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.evaluation import misses, protocols, scores
from downstream_hpe.evaluation.reliability import reliability
from downstream_hpe.evaluation.scored_rows import Measured
from downstream_hpe.geometry.rotation import rotation_from_angles

ENDS = np.linspace(-60, 60, 7)
"""Of six intervals of 20 degrees."""


def at(yaw) -> np.ndarray:
    """Angles [N, 3] with these yaws, and no pitch and roll."""
    return np.column_stack([yaw, np.zeros(len(yaw)), np.zeros(len(yaw))])


# ---- intervals ----------------------------------------------------------


def test_an_interval_has_its_lower_end_and_the_last_one_both():
    yaw = [-60.0, -40, -39.5, 0, 19.999, 20, 60, 60.001, -60.001]
    counts = [1, 2, 0, 2, 1, 1]
    found = scores.evaluate("x", at(yaw), rotation_from_angles(at(yaw)), (60, 40, 30))
    assert [i.count for i in found.intervals if i.angle == "yaw"] == counts
    assert [(i.low, i.high) for i in found.intervals[:6]] == list(pairwise(ENDS))
    assert [i.angle for i in found.intervals] == ["yaw"] * 6 + ["pitch"] * 6 + ["roll"] * 6
    rows = misses.misses(at(yaw), at([*yaw[:3], 60.0]), (60, 40, 30))
    assert [r.count - r.missed for r in rows[:6]] == counts
    assert [r.missed for r in rows[:6]] == [1, 2, 0, 0, 0, 1]
    assert [(r.low, r.high) for r in rows[:6]] == [(i.low, i.high) for i in found.intervals[:6]]
    # All of pitch is 0, which is the lower end of the fourth interval.
    assert [r.count for r in rows[6:12]] == [0, 0, 0, len(yaw) + 4, 0, 0]


def test_errors_are_means_of_their_rows(tmp_path: Path):
    true = at([10.0, 10, -30])
    said = true + np.array([[1, 2, -3], [3, -2, 1], [-5, 0, 0]])
    found = scores.evaluate("one | two", said, rotation_from_angles(true), (60, 40, 30))
    assert found.mae == pytest.approx((3, 4 / 3, 4 / 3)) and found.mean_mae == pytest.approx(17 / 9)
    of_yaw = [i for i in found.intervals if i.angle == "yaw"]
    assert of_yaw[3].mae == pytest.approx(2) and of_yaw[1].mae == pytest.approx(5)
    assert np.isnan(of_yaw[0].mae) and np.isnan(of_yaw[0].geodesic)
    assert found.geodesic_errors[2] == pytest.approx(5) == of_yaw[1].geodesic
    assert found.geodesic == pytest.approx(found.geodesic_errors.mean())
    # Turned by 5 degrees about y, two axes of three go by as much.
    alone = scores.evaluate("x", said[2:], rotation_from_angles(true[2:]))
    assert alone.maev == pytest.approx(10 / 3) and alone.count == 1
    lines = scores.markdown([found, alone]).splitlines()
    assert lines[2].startswith("| one &#124; two | 3 | 3.00 | 1.33 | 1.33 | 1.89 |")
    assert lines[3] == "| x | 1 | 5.00 | 0.00 | 0.00 | 1.67 | 3.33 | 5.00 |"
    assert lines[5] == "| angle | interval | rows | one &#124; two | x |"
    assert len(lines) == 7 + 18 and lines[7 + 3] == "| yaw | 0 to 20 | 2 | 2.00 | - |"
    assert scores.summary(alone)["mae"] == pytest.approx(5 / 3)
    scores.write_csv([alone], tmp_path / "s.csv")
    rows = list(csv.reader((tmp_path / "s.csv").read_text().splitlines()))
    assert len(rows) == 1 + 4 + 18
    assert rows[1] == ["x", "all", "", "", "1", "1.666667", "3.333333", "5.000000"]
    assert rows[2] == ["x", "yaw", "", "", "1", "5.000000", "", ""]
    assert rows[5] == ["x", "yaw", "-50", "-33.3333", "0", "", "", ""]
    assert rows[6] == ["x", "yaw", "-33.3333", "-16.6667", "1", "5.000000", "", "5.000000"]


def test_no_rows_other_shapes_and_what_is_not_finite():
    turned = np.eye(3)[None]
    for said, rows in (
        (np.empty((0, 3)), turned[:0]),
        (np.zeros((2, 3)), turned),
        (np.zeros((1, 2)), turned),
    ):
        with pytest.raises(DataError, match="expected"):
            scores.evaluate("x", said, rows)
    with pytest.raises(DataError, match="not finite"):
        scores.evaluate("x", np.array([[0, np.nan, 0]]), turned)


def test_bounds_count_themselves():
    poses = np.array([[50.0, 40, 30], [-50, -40, -30], [50.001, 0, 0], [0, -40.001, 0], [0, 0, 30.001]])
    assert scores.within_bounds(poses).tolist() == [True, True, False, False, False]


# ---- misses -------------------------------------------------------------


def test_intervals_that_miss_rows_are_told(tmp_path: Path):
    rows = misses.misses(at([-45.0, -45, 5]), at([-45.0, 5]), (60, 40, 30))
    lines = misses.markdown(rows).splitlines()
    assert lines[2:] == [
        "| yaw | -60 to -40 | 3 | 1 (33%) |",
        "| yaw | 0 to 20 | 2 | 1 (50%) |",
        "| pitch | 0 to 13.33 | 5 | 2 (40%) |",
        "| roll | 0 to 10 | 5 | 2 (40%) |",
    ]
    misses.write_csv(rows, tmp_path / "m.csv")
    told = list(csv.reader((tmp_path / "m.csv").read_text().splitlines()))
    assert told[0] == ["angle", "low_deg", "high_deg", "rows", "no_face_found"] and len(told) == 19
    assert told[1] == ["yaw", "-60", "-40", "3", "1"]


# ---- protocols ----------------------------------------------------------


@dataclass(frozen=True)
class FewRows:
    """As much of rows as a protocol looks at."""

    ypr_deg: np.ndarray

    def take(self, chosen: np.ndarray) -> FewRows:
        return replace(self, ypr_deg=self.ypr_deg[chosen])


def measured(found, missed, own=None) -> Measured:
    return Measured(FewRows(at(found)), at(missed), own_points=own)  # type: ignore[arg-type]


def test_a_protocol_takes_its_rows_and_says_what_is_left_out():
    told: list[str] = []
    own = np.arange(3)
    before = measured([0.0, 50, 51], [10.0, -60], own)
    after = protocols.under("paper-bounds", "aflw2000", before, Path("x"), told.append)
    assert after.rows.ypr_deg[:, 0].tolist() == [0, 50] and after.missed_deg[:, 0].tolist() == [10]
    assert after.own_points.tolist() == [0, 1]
    assert told == ["1 rows outside 50, 40, 30 degrees left out"]
    told.clear()
    whole = protocols.under("paper-bounds", "aflw2000", measured([0.0], []), Path("x"), told.append)
    assert whole.own_points is None and not told
    with pytest.raises(DataError, match="x: no pose within 50, 40, 30 degrees"):
        protocols.under("paper-bounds", "aflw2000", measured([60.0], [0.0]), Path("x"), told.append)


@pytest.mark.parametrize(
    ("name", "layout", "count", "bound"),
    [
        ("99", "aflw2000", 1969, 99),
        ("fsanet-biwi", "biwi-npz", 13219, 99),
        ("biwi-15677", "biwi", 15677, 180),
        ("biwi-15677", "biwi-colour", 15677, 180),
    ],
)
def test_the_numbers_of_the_papers(name: str, layout: str, count: int, bound: float):
    """Found and missed together; beyond the bounds none counts."""
    told: list[str] = []
    assert protocols.PROTOCOLS[name].bounds_deg == (bound,) * 3
    right = measured(np.zeros(count - 5), np.zeros(5))
    protocols.under(name, layout, right, Path("x"), told.append)
    assert not told
    protocols.under(name, layout, measured(np.zeros(count - 5), np.zeros(4)), Path("x"), told.append)
    assert told == [f"{count - 1} labels, and protocol {name} has {count}: not comparable with the papers"]


def test_a_protocol_of_other_files_is_refused():
    protocols.check_protocol("fsanet-biwi", "biwi-npz")
    protocols.check_protocol("99", "biwi")
    with pytest.raises(UsageError, match="is about --format biwi or biwi-colour, not aflw2000"):
        protocols.check_protocol("biwi-15677", "aflw2000")


# ---- what was said and came true ----------------------------------------


def test_confidence_in_its_intervals():
    said = np.array([0.0, 0.05, 0.1, 0.6, 0.75, 0.95, 1.0])
    errors = np.array([9.0, 3, 4.999, 5, 1, 2, 3])
    assert reliability(said, errors).splitlines()[2:] == [
        "| 0 to 0.1 | 2 | 0.03 | 0.50 | 6.00 |",
        "| 0.1 to 0.25 | 1 | 0.10 | 1.00 | 5.00 |",
        "| 0.5 to 0.75 | 1 | 0.60 | 0.00 | 5.00 |",
        "| 0.75 to 0.9 | 1 | 0.75 | 1.00 | 1.00 |",
        "| 0.9 to 1 | 2 | 0.97 | 1.00 | 2.50 |",
    ]
    assert reliability(said, errors, (0, 0.5, 1)).splitlines()[2:] == [
        "| 0 to 0.5 | 3 | 0.05 | 0.67 | 5.67 |",
        "| 0.5 to 1 | 4 | 0.82 | 0.75 | 2.75 |",
    ]

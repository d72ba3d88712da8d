# SPDX-License-Identifier: GPL-3.0-or-later
"""Missing detections: three choices, each marked on the row."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from generator.dataset.format.missing import (
    CHOICES,
    MISSING,
    Missing,
    exact_in_pixels,
    fill_missing,
    rotated_frontal,
)
from generator.dataset.format.open import as_array
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.errors import UsageError
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import geodesic_deg
from generator.registries import FORMATS

SCHEMA = part_schema("none", {"headturn": "0"}, "")


@pytest.mark.parametrize("choice", ["keep", "masked"])
def test_keep_leaves_what_is_missing_missing(rows: UnitRows, choice: str) -> None:
    """masked is what keep was called before."""
    landmarks, origin = fill_missing(unit_table(rows, SCHEMA), choice)
    assert (origin == np.where(rows.detected, "detected", "missing")).all()
    assert np.isnan(landmarks[~rows.detected]).all()


def test_exact_fills_what_an_ideal_detector_would_say(rows: UnitRows) -> None:
    """The fixture's detector is ideal, so where it did see the face both agree."""
    table = unit_table(rows, SCHEMA)
    ideal = exact_in_pixels(table)
    anchored = np.isfinite(rows.anchors).all(axis=1)
    np.testing.assert_allclose(
        ideal[rows.detected][:, anchored], rows.landmarks[rows.detected][:, anchored], atol=2e-3
    )
    landmarks, origin = fill_missing(table, "exact")
    assert set(origin[~rows.detected]) == {"exact"}
    np.testing.assert_array_equal(landmarks[rows.detected], rows.landmarks[rows.detected])
    np.testing.assert_array_equal(landmarks[~rows.detected], ideal[~rows.detected])
    assert np.isnan(landmarks[~rows.detected][:, ~anchored]).all(), "no anchor, no point"


def test_frontal_is_turned_to_the_pose(rows: UnitRows) -> None:
    table = unit_table(rows, SCHEMA)
    rotation = as_array(table, "rotation").reshape(-1, 3, 3)
    turned = rotated_frontal(table)
    front = int(np.flatnonzero((rows.angles_deg == 0).all(axis=1))[0])
    np.testing.assert_allclose(turned[front], rows.landmarks[front], atol=1e-3)
    for row in range(len(rotation)):
        fit = fit_similarity(rows.landmarks[front], turned[row])
        assert geodesic_deg(fit.rotation, rotation[row]) < 1e-3
    _, origin = fill_missing(table, "frontal")
    assert (origin == np.where(rows.detected, "detected", "frontal")).all()


def test_nothing_to_fill_with_is_said(rows: UnitRows) -> None:
    from dataclasses import replace

    nothing = replace(
        rows,
        detected=np.zeros(18, bool),
        landmarks=np.full_like(rows.landmarks, np.nan),
        anchors=np.full((468, 3), np.nan),
        visible=np.zeros((18, 468), bool),
    )
    table = unit_table(nothing, SCHEMA)
    for choice in ("exact", "frontal"):
        landmarks, origin = fill_missing(table, choice)
        assert set(origin) == {"missing"}
        assert np.isnan(landmarks).all()
    with pytest.raises(UsageError, match=r"'zeros' is none of keep, exact, frontal"):
        fill_missing(table, "zeros")


def test_there_is_one_name_for_each_thing_to_do() -> None:
    names = get_args(Missing)
    assert names == tuple(MISSING) == ("fail", "keep", "skip", "exact", "frontal")
    assert set(CHOICES) <= set(names)
    for name in FORMATS:
        assert set(FORMATS.get(name).missing) <= set(names)

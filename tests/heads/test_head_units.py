# SPDX-License-Identifier: GPL-3.0-or-later
"""Units from the size of a face, and axes."""

from __future__ import annotations

import numpy as np
import pytest

from generator.errors import HeadError, UsageError
from generator.heads.units import CANDIDATE_AXES, axes_rotation, guess_units


@pytest.mark.parametrize(("unit", "mm"), [("um", 0.001), ("mm", 1), ("cm", 10), ("dm", 100), ("m", 1000)])
@pytest.mark.parametrize("distance_mm", [61, 90.5, 129])
def test_units_are_guessed_from_the_outer_eye_corners(unit: str, mm: float, distance_mm: float) -> None:
    assert guess_units(distance_mm / mm) == (unit, mm)


@pytest.mark.parametrize("distance", [0.0, -90.0, 3.5, 40.0, float("nan"), float("inf")])
def test_no_size_of_a_face_asks_for_units(distance: float) -> None:
    with pytest.raises(HeadError, match="--units"):
        guess_units(distance)


def test_axes_become_frame_u() -> None:
    for up, forward in CANDIDATE_AXES:
        rotation = axes_rotation(up, forward)
        assert np.linalg.det(rotation) == pytest.approx(1)
        for text, image in ((up, [0, 1, 0]), (forward, [0, 0, 1])):
            source = np.eye(3)["XYZ".index(text[1])] * (1 if text[0] == "+" else -1)
            np.testing.assert_array_equal(rotation @ source, image)
    np.testing.assert_array_equal(axes_rotation("+Y", "+Z"), np.eye(3))
    assert len(set(CANDIDATE_AXES)) == len(CANDIDATE_AXES)


@pytest.mark.parametrize(
    ("up", "forward"), [("+Y", "+Y"), ("+Y", "-Y"), ("Y", "+Z"), ("+Y", "+W"), ("", "+Z")]
)
def test_impossible_axes(up: str, forward: str) -> None:
    with pytest.raises(UsageError):
        axes_rotation(up, forward)

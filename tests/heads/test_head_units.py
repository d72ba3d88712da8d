# SPDX-License-Identifier: GPL-3.0-or-later
"""Units from the size of a face, and axes."""

from __future__ import annotations

import numpy as np
import pytest

from generator.errors import HeadError, UsageError
from generator.heads.units import CANDIDATE_AXES, axes_rotation, guess_units, is_scale, scale_of


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


def test_a_mesh_of_no_unit_is_scaled_by_its_eyes_and_that_is_said() -> None:
    units, scale, notes = scale_of(0.31, None, None)
    assert (units, scale * 0.31) == ("eyes", pytest.approx(90, rel=1e-5))
    assert "90 mm" in notes[0] and "--eye-distance" in notes[0]
    units, scale, notes = scale_of(21.0, "mm", 84.0)
    assert (units, scale, is_scale(units, scale)) == ("eyes", 4.0, True)
    assert "84 mm" in notes[0]
    assert scale_of(9.1, None, None)[:2] == ("cm", 10.0)


@pytest.mark.parametrize(
    ("eyes", "units"), [(0.31, "m"), (91.0, "cm"), (9.1, "mm"), (0.0, "mm"), (0.0, None)]
)
def test_a_unit_that_makes_it_no_face_is_refused(eyes: float, units: str | None) -> None:
    with pytest.raises(HeadError):
        scale_of(eyes, units, None)
    assert not is_scale("eyes", float("nan")) and not is_scale("cm", 1.0)

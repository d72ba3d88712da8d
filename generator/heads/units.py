# SPDX-License-Identifier: GPL-3.0-or-later
"""Length units and axes of meshes that do not say what they use."""

from __future__ import annotations

import math

import numpy as np

from generator.errors import HeadError, UsageError

MM_PER_UNIT = {"um": 0.001, "mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0}
"""Millimetres in one source unit."""

OUTER_EYE_DISTANCE_MM = (60.0, 130.0)
"""Between the outer eye corners: about 90 mm in adults, with room for children and stylised heads.
The window spans a factor of 2.2, so that no distance fits two units, which are at least 10 apart."""

BLENDER_AXES = ("+Z", "-Y")
"""(up, forward) of a head that was made in Blender."""

CANDIDATE_AXES = (
    ("+Y", "+Z"),  # FaceScape, FLAME, MakeHuman, glTF
    BLENDER_AXES,  # and Z-up CAD and scanner exports
    ("+Z", "+Y"),
    ("+Y", "-Z"),
    ("+Y", "+X"),
    ("+Y", "-X"),
    ("+Z", "+X"),
    ("+Z", "-X"),
    ("-Y", "-Z"),  # computer-vision frame C
    ("-Y", "+Z"),
    ("-Z", "+Y"),
    ("-Z", "-Y"),
    ("+X", "+Z"),
    ("-X", "+Z"),
)
"""(up, forward) to try, likeliest first, when a source does not say."""


BY_EYES = "eyes"
"""What stands for the unit of a mesh that is scaled by the distance between its eyes."""

USUAL_EYE_DISTANCE_MM = 90.0
"""Between the outer eye corners of a mesh of no unit, where nothing says how much it is."""


def scale_of(eyes: float, units: str | None, eye_distance_mm: float | None) -> tuple[str, float, list[str]]:
    """Unit of a mesh, millimetres in one of it, and what of that was guessed, a line each.

    Parameters
    ----------
    eyes: between the outer eye corners, in source units.
    units: what is said to be the unit; checked against the size of a face.
    eye_distance_mm: what the eyes are apart; it decides, whatever the unit.

    Raises
    ------
    HeadError: the unit that is said makes this no size of a face, or it has no size.
    """
    if not (math.isfinite(eyes) and eyes > 0):
        raise HeadError("the outer eye corners lie on one point; no face can be measured there")
    if eye_distance_mm is not None:
        note = f"scaled so that the outer eye corners, {eyes:.4g} apart, are {eye_distance_mm:g} mm apart"
        return BY_EYES, _rounded(eye_distance_mm / eyes), [note]
    low, high = OUTER_EYE_DISTANCE_MM
    if units is not None:
        found = eyes * MM_PER_UNIT[units]
        if not low <= found <= high:
            raise HeadError(
                f"in {units} the outer eye corners are {found:.4g} mm apart, and {low:.0f}-{high:.0f} mm are "
                f"a face; correct the unit (--units), or give --eye-distance {found:.0f} if it is right"
            )
        return units, MM_PER_UNIT[units], []
    try:
        name, mm = guess_units(eyes)
    except HeadError:
        usual = USUAL_EYE_DISTANCE_MM
        note = (
            f"in no unit: the outer eye corners, {eyes:.4g} apart, are taken to be {usual:g} mm apart; "
            "--eye-distance says otherwise"
        )
        return BY_EYES, _rounded(usual / eyes), [note]
    return name, mm, [f"units guessed: {name} (outer eye corners {eyes:.4g} apart)"]


def _rounded(scale: float) -> float:
    """To six digits: the last ones of what a detector finds change from run to run."""
    return float(f"{scale:.6g}")


def is_scale(units: str, mm_per_unit: float) -> bool:
    """Can a mesh in these units have so many millimetres in one?"""
    if units == BY_EYES:
        return math.isfinite(mm_per_unit) and mm_per_unit > 0
    return MM_PER_UNIT.get(units) == mm_per_unit


def guess_units(outer_eye_distance: float) -> tuple[str, float]:
    """Unit of a mesh from the distance between its outer eye corners.

    Parameters
    ----------
    outer_eye_distance: in source units.

    Returns
    -------
    (name, millimetres in one unit).

    Raises
    ------
    HeadError: no unit makes this the size of a face.
    """
    low, high = OUTER_EYE_DISTANCE_MM
    for name, mm in MM_PER_UNIT.items():
        if low <= outer_eye_distance * mm <= high:
            return name, mm
    raise HeadError(
        f"the outer eye corners are {outer_eye_distance:.4g} units apart, which is no size of a face in "
        f"{', '.join(MM_PER_UNIT)} ({low:.0f}-{high:.0f} mm expected); give the unit with --units"
    )


def axes_rotation(up: str, forward: str) -> np.ndarray:
    """Rotation from source coordinates to frame U: ``up`` becomes +Y, ``forward`` +Z.

    Parameters
    ----------
    up, forward: signed axes such as "+Y" and "-Z".

    Returns
    -------
    float64 [3, 3], proper; rows are the source directions of frame U's axes.

    Raises
    ------
    UsageError: not a signed axis, or both lie along the same one.
    """
    y, z = axis_vector(up, "--up"), axis_vector(forward, "--forward")
    if math.isclose(abs(float(y @ z)), 1.0):
        raise UsageError(f"--up {up} and --forward {forward} lie along the same axis; give two axes")
    return np.stack([np.cross(y, z), y, z])


def axis_vector(text: str, option: str) -> np.ndarray:
    """Unit vector float64 [3] of a signed axis. UsageError, naming ``option``, if it is none."""
    sign, name = text[:1], text[1:].upper()
    if sign not in ("+", "-") or name not in ("X", "Y", "Z"):
        raise UsageError(f"{option} {text!r} is not an axis; write one of +X -X +Y -Y +Z -Z")
    axis = np.zeros(3)
    axis["XYZ".index(name)] = 1.0 if sign == "+" else -1.0
    return axis

# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of numbers in Blender's fields.

Blender writes millimetres and pixels behind a number that is one. It writes degrees behind radians alone, and
our angles are degrees: so beside each stands a second property, in radians, that is shown in its place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

DEGREES = "degrees"

OPTIONS: dict[str, dict[str, Any]] = {"mm": {"subtype": "DISTANCE_CAMERA"}, "pixels": {"subtype": "PIXEL"}}
"""Of a property, by the unit of its setting; Blender's cameras count in millimetres, too."""

_SHOWN = "_angle"
_DIGITS = 4
"""Of degrees: what 32 bits of radians hold of any angle."""

_KEPT = ("name", "description", "size", "step")
_ENDS = ("min", "max", "soft_min", "soft_max")


def angle_of(name: str) -> str:
    """The property that shows an angle."""
    return name + _SHOWN


def is_angle(name: str) -> bool:
    """Does a property only show another one?"""
    return name.endswith(_SHOWN)


def angle_options(options: dict[str, Any]) -> dict[str, Any]:
    """Of the property that shows one with these options."""
    ends = {key: math.radians(options[key]) for key in _ENDS if key in options}
    kept: dict[str, Any] = {key: options[key] for key in _KEPT if key in options}
    kept["precision"] = _DIGITS  # Blender writes those that are not 0
    return {**kept, **ends, **({"unit": "ROTATION"} if "size" in options else {"subtype": "ANGLE"})}


def radians(degrees: float | Sequence[float]) -> Any:
    """What is shown of an angle, or of several."""
    if isinstance(degrees, (int, float)):
        return math.radians(degrees)
    return tuple(map(math.radians, degrees))


def degrees(shown: float | Sequence[float], before: float | Sequence[float]) -> Any:
    """The angle, or several, that somebody edited to be shown so. What he left alone keeps its digits."""
    if isinstance(shown, (int, float)):
        assert isinstance(before, (int, float))
        left = math.isclose(shown, math.radians(before), rel_tol=2e-7, abs_tol=1e-9)
        return before if left else round(math.degrees(shown), _DIGITS)
    assert not isinstance(before, (int, float))
    return tuple(degrees(*pair) for pair in zip(shown, before, strict=True))

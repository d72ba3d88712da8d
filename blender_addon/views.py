# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's 3D views, remembered before the studio changes them, and given back.

A view belongs to a screen and not to a scene: the window that goes back to a scene of the user's would keep
the studio's shading. What it was is kept in the screen itself, so it outlasts a saved file.
"""

from __future__ import annotations

import json
from typing import Any

import bpy

from . import own

KEPT = "headturn_views"
"""Custom property of a screen: JSON of what its 3D views were, in the order of its areas."""

_REGION = (
    *("view_perspective", "view_rotation", "view_location", "view_distance"),
    *("view_camera_zoom", "view_camera_offset"),
)
_SHADING = ("type", "light", "color_type", "background_type", "background_color")


def keep(screen: bpy.types.Screen) -> None:
    """Remember the views of a screen, unless they are remembered."""
    if KEPT not in screen:
        screen[KEPT] = json.dumps([_read(space) for space in _spaces(screen)])


def give_back() -> None:
    """Views that show a scene of the user's are as they were."""
    windows = bpy.context.window_manager.windows
    ours = [window.screen for window in windows if own.is_own(window.scene)]
    for screen in bpy.data.screens:
        if KEPT in screen and screen not in ours:
            was = json.loads(screen[KEPT])
            del screen[KEPT]
            # Of an area that was split since, both halves are as it was.
            for place, space in enumerate(_spaces(screen)):
                _write(space, was[min(place, len(was) - 1)])


def _spaces(screen: bpy.types.Screen) -> list[bpy.types.SpaceView3D]:
    return [area.spaces.active for area in screen.areas if area.type == "VIEW_3D"]


def _read(space: bpy.types.SpaceView3D) -> dict[str, dict[str, Any]]:
    places = {"region_3d": _REGION, "shading": _SHADING}
    return {
        place: {name: _plain(getattr(getattr(space, place), name)) for name in names}
        for place, names in places.items()
    }


def _write(space: bpy.types.SpaceView3D, was: dict[str, dict[str, Any]]) -> None:
    for place, values in was.items():
        for name, value in values.items():
            setattr(getattr(space, place), name, value)


def _plain(value: Any) -> Any:
    return value if isinstance(value, str | float | int) else list(value)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in Blender's file, property by property, to be compared before and after."""

from __future__ import annotations

from itertools import islice
from typing import Any

import bpy

NOT_SAID = {
    *("rna_type", "headturn", "headturn_own", "session_uid", "users", "depsgraph", "original"),
    *("perspective_matrix", "view_matrix", "window_matrix", "is_evaluated", "filepath_raw"),
    *("is_updated", "is_updated_data", "tag", "type_info", "is_dirty", "regions", "is_perspective"),
    *("local_view", "clip_planes", "uv_sculpt", "particle_edit", "storage_type"),
}
"""Ours, or what Blender computes; uv_sculpt leads nowhere in 4.3, once a file was opened."""

ADDONS = ("headturn", "cycles")
"""Whose properties Blender keeps as custom ones, before 5.0, from when they are first read."""

MANY = 1000
"""Of so many vertices, corners or the like, one of 250 is looked at."""

COUNTED = (
    *("scenes", "collections", "objects", "meshes", "cameras", "lights", "worlds", "materials"),
    *("node_groups", "images", "texts", "actions", "screens"),
)


def whole_file(kinds: tuple[str, ...] = COUNTED) -> dict[str, Any]:
    """ "kind/name" -> all of its properties, by name, nested. Of what is ours, that it is there."""
    said: dict[str, Any] = {}
    for kind in kinds:
        for one in getattr(bpy.data, kind):
            custom = [*one.keys()]
            name = f"{kind}/{one.name}"
            if "headturn_own" in custom:
                said[name] = {}
                continue
            said[name] = _screen(one) if kind == "screens" else _struct(one, set())
            said[name]["custom properties"] = [key for key in custom if not key.startswith(ADDONS)]
    return said


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What is not the same, by its path. What is new in after counts, too."""
    found: list[str] = []
    _compare("", before, after, found)
    return found


def _screen(screen: bpy.types.Screen) -> dict[str, Any]:
    """Its areas and what its 3D views show; of other areas Blender cannot read all without a window."""
    said: dict[str, Any] = {"areas": [area.type for area in screen.areas]}
    for place, area in enumerate(screen.areas):
        if area.type == "VIEW_3D":
            space = area.spaces.active
            said[f"view {place}"] = {
                name: _struct(getattr(space, name), set()) for name in ("region_3d", "shading", "overlay")
            }
    return said


def _struct(struct: Any, above: set[int]) -> dict[str, Any]:
    said = {}
    above = above | {hash((struct.as_pointer(), type(struct)))}
    for prop in struct.bl_rna.properties:
        if prop.identifier not in NOT_SAID:
            try:
                value = getattr(struct, prop.identifier)
            except (AttributeError, TypeError, RuntimeError):  # Blender has a few that cannot be read here
                continue
            said[prop.identifier] = _value(prop, value, above)
    return said


def _value(prop: Any, value: Any, above: set[int]) -> Any:
    if prop.type == "POINTER":
        return _pointed(value, above)
    if prop.type == "COLLECTION":
        every = 1 if len(value) < MANY else MANY // 4
        return [len(value), *(_pointed(one, above) for one in islice(value, 0, None, every))]
    if getattr(prop, "is_array", False):
        return [list(row) if hasattr(row, "__len__") else row for row in value]
    return sorted(value) if isinstance(value, set) else value


def _pointed(value: Any, above: set[int]) -> Any:
    if value is None:
        return None
    if isinstance(value, bpy.types.ID) and not getattr(value, "is_embedded_data", False):
        return f"{type(value).__name__} {value.name_full}"
    if hash((value.as_pointer(), type(value))) in above or len(above) > 5:
        return "..."
    return _struct(value, above)


def _compare(path: str, before: Any, after: Any, found: list[str]) -> None:
    if isinstance(before, dict) and isinstance(after, dict):
        for name in sorted({*before, *after}):
            if (name in before) != (name in after):
                found.append(f"{path}/{name}: only {'before' if name in before else 'after'}")
            else:
                _compare(f"{path}/{name}", before[name], after[name], found)
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for place, pair in enumerate(zip(before, after, strict=True)):
            _compare(f"{path}[{place}]", *pair, found)
    elif before != after and not (before != before and after != after):  # not a number, both
        found.append(f"{path}: {before!r} -> {after!r}")

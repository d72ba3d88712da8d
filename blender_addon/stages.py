# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage of each scene, kept from one edit to the next while everything it made is still there.

A stage holds on to Blender's own data. Undo, and whoever deletes something, takes that away: then
the stage is forgotten, and the next edit builds another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    from generator.blender.stage import Stage

_kept: dict[str, tuple[Stage, tuple[int, ...]]] = {}


def keep(scene: bpy.types.Scene, stage: Stage) -> None:
    """Remember the stage that was built in a scene."""
    _kept[scene.name] = (stage, _pointers(scene))


def kept(scene: bpy.types.Scene) -> Stage | None:
    """The stage of a scene, if all of it is there."""
    stage, pointers = _kept.get(scene.name, (None, ()))
    return stage if pointers == _pointers(scene) else None


def forget() -> None:
    """What stages made is there no longer."""
    _kept.clear()


def _pointers(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Everything that a stage can set, by its place in memory."""
    found: list[Any] = [scene, scene.world, scene.world and scene.world.node_tree]
    for thing in scene.objects:
        found += [thing, thing.data]
        for material in getattr(thing.data, "materials", ()):
            found += [material, material and material.node_tree]
    return tuple(one.as_pointer() if one is not None else 0 for one in found)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage of each scene, kept from one edit to the next while everything it made is still there.

A stage holds on to Blender's own data. Undo, and whoever deletes something, takes that away: then
the stage is forgotten, and the next edit builds another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

from . import own

if TYPE_CHECKING:
    from generator.blender.stage import Stage

_kept: dict[int, tuple[Stage, tuple[int, ...]]] = {}
_turned: dict[int, tuple[float, ...]] = {}


def keep(scene: bpy.types.Scene, stage: Stage) -> None:
    """Remember the stage that was built in a scene."""
    _kept[scene.session_uid] = (stage, _pointers(scene))


def kept(scene: bpy.types.Scene) -> Stage | None:
    """The stage of a scene, if all of it is there."""
    stage, pointers = _kept.get(scene.session_uid, (None, ()))
    return stage if pointers == _pointers(scene) else None


def keep_turned(scene: bpy.types.Scene, pose: tuple[float, ...]) -> None:
    """The head of a scene was turned to this pose."""
    _turned[scene.session_uid] = tuple(pose)


def turned(scene: bpy.types.Scene) -> tuple[float, ...] | None:
    """The pose that the head of a scene was last turned to, None if that is not known."""
    return _turned.get(scene.session_uid)


def forget() -> None:
    """What stages made is there no longer."""
    _kept.clear()
    _turned.clear()


def _pointers(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Everything that a stage can set, by its place in memory."""
    found: list[Any] = [scene, scene.world, scene.world and scene.world.node_tree]
    for thing in own.things(scene):
        found += [thing, thing.data]
        for material in getattr(thing.data, "materials", ()):
            found += [material, material and material.node_tree]
    return tuple(one.as_pointer() if one is not None else 0 for one in found)

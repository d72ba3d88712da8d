# SPDX-License-Identifier: GPL-3.0-or-later
"""A turntable of ours under the head in the user's own scene. What it changes is a constraint an object.

The constraint stands last, so that everything else of the object stays as it is. Letting go takes it away,
with the turntable and the frame range of the preview.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
from mathutils import Matrix, Vector

from . import own
from .core.turning import Turning

NAME = "Headturn turntable"
UNSEEN = 1e-4
"""Size of its axes, which would cross the picture."""

_TURNING, _FRAMES = "headturn_turning", "headturn_frames"
"""Custom properties of the turntable: how it turns; start, end and current frame before it."""


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The turntable of a scene."""
    if own.is_own(scene):
        return None
    return next((one for one in own.things(scene) if _TURNING in one), None)


def hang(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object], turning: Turning) -> None:
    """Have some objects, and what is parented to them, turn from now on."""
    let_go(scene)
    with own.making(scene):
        table = bpy.data.objects.new(NAME, None)
        scene.collection.objects.link(table)
    table.empty_display_size = UNSEEN
    table[_TURNING] = turning.numbers
    table[_FRAMES] = [scene.frame_start, scene.frame_end, scene.frame_current]
    table.matrix_world = Matrix.Translation(Vector(turning.pivot.tolist()))
    _constrain(objects, table)


def show(scene: bpy.types.Scene, pose: tuple[float, float, float]) -> None:
    """Turn the head to a pose; nothing where no turntable is."""
    table = find(scene)
    if table is None:
        return
    table.matrix_world = Matrix(Turning.of_numbers([*table[_TURNING]]).at(pose).tolist())


def let_go(scene: bpy.types.Scene) -> None:
    """The head stands as it stood, and nothing of ours is left in the scene."""
    table = find(scene)
    if table is None:
        return
    _release(table)
    start, end, current = table[_FRAMES]
    own.remove([table])
    for place in [one for one in scene.collection.children if own.is_own(one)]:
        if not place.objects and not place.children:
            bpy.data.collections.remove(place)
    scene.frame_start, scene.frame_end = start, end
    scene.frame_set(current)


@contextmanager
def lifted(scene: bpy.types.Scene) -> Iterator[None]:
    """A block in which the scene stands as its user made it. Whoever follows its frames must not, in it."""
    table = find(scene)
    objects = [] if table is None else _release(table)
    frame, range_ = scene.frame_current, (scene.frame_start, scene.frame_end)
    if table is not None:
        start, end, current = table[_FRAMES]
        scene.frame_start, scene.frame_end = start, end
        scene.frame_set(current)
    try:
        yield
    finally:
        if table is not None:
            scene.frame_start, scene.frame_end = range_
            _constrain(objects, table)
            scene.frame_set(frame)


def _constrain(objects: Sequence[bpy.types.Object], table: bpy.types.Object) -> None:
    pivot = Vector(Turning.of_numbers([*table[_TURNING]]).pivot.tolist())
    for one in objects:
        active = next((other for other in one.constraints if other.active), None)
        constraint = one.constraints.new("CHILD_OF")
        constraint.name, constraint.target = NAME, table
        constraint.inverse_matrix = Matrix.Translation(-pivot)
        if active is not None:
            active.active = True


def _release(table: bpy.types.Object) -> list[bpy.types.Object]:
    """Take the constraints away. Returns whose they were."""
    found = []
    for one in bpy.data.objects:
        for constraint in [c for c in one.constraints if c.type == "CHILD_OF" and c.target == table]:
            one.constraints.remove(constraint)
            found.append(one)
    return found

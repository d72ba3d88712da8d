# SPDX-License-Identifier: GPL-3.0-or-later
"""What is the add-on's own in a file. It carries a tag, and what stands in a scene stands in one collection.

Nothing without the tag is ever removed, renamed or changed. An object is only taken for ours where it stands
in our collection: whoever copies one of ours and puts it somewhere else has one of his own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

NAME = "Headturn"
TAG = "headturn_own"
"""Custom property of what is ours: PART, or what it is kept as."""

PART = "part"
"""Of a stage: it goes once nobody uses it."""

_KINDS = (
    *("collections", "objects", "meshes", "cameras", "lights"),
    *("worlds", "materials", "node_groups", "images", "texts"),
)


def keep(one: bpy.types.ID, what: str) -> None:
    """Have this as ours, until everything of ours is removed."""
    one[TAG] = what


def is_own(one: bpy.types.ID | None) -> bool:
    """Is it ours?"""
    return one is not None and TAG in one


def kept(among: Iterable[Any], what: str) -> Any:
    """What is kept as this, whatever its name; None if there is none."""
    return next((one for one in among if one.get(TAG) == what), None)


def scenes() -> list[bpy.types.Scene]:
    """Scenes of ours."""
    return [scene for scene in bpy.data.scenes if is_own(scene)]


def things(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects of ours in a scene."""
    place = _collection(scene)
    return [thing for thing in place.objects if is_own(thing)] if place is not None else []


def head(shown: Any) -> bpy.types.Object | None:
    """The head in view; None also where somebody deleted it."""
    thing = shown.head
    return thing if thing is not None and shown.id_data.objects.get(thing.name) == thing else None


@contextmanager
def making(scene: bpy.types.Scene) -> Iterator[None]:
    """Whatever is made in here is ours, and its objects stand in our collection of the scene."""
    before = {one.session_uid for one in _everything()}
    try:
        yield
    finally:
        made = [one for one in _everything() if one.session_uid not in before]
        place = _collection(scene)
        if place is None:
            place = bpy.data.collections.new(NAME)
            keep(place, PART)
            scene.collection.children.link(place)
        for one in made:
            keep(one, PART)
            if isinstance(one, bpy.types.Object):
                one.hide_select = True
                if scene.collection.objects.get(one.name) == one:
                    place.objects.link(one)
                    scene.collection.objects.unlink(one)


def pack() -> None:
    """The file takes the pictures of heads and light along, wherever it goes."""
    for image in bpy.data.images:
        if image.get(TAG) == PART and image.source == "FILE" and not image.packed_files:
            image.pack()


def remove(gone: Iterable[bpy.types.Object]) -> None:
    """Remove objects of ours, and all data of ours that nobody uses then."""
    for thing in gone:
        bpy.data.objects.remove(thing)
    while left := [one for one in _everything() if one.get(TAG) == PART and not one.users]:
        bpy.data.batch_remove(left)


def remove_all() -> list[bpy.types.Scene]:
    """Remove everything of ours. Returns scenes of ours that stay: somebody put something else into them."""
    stay = []
    for scene in scenes():
        place = _collection(scene)
        remove(things(scene))
        if place is not None and not place.objects and not place.children:
            bpy.data.collections.remove(place)
        if scene.objects or scene.collection.children or len(bpy.data.scenes) == 1:
            stay.append(scene)
            scene.world = None if is_own(scene.world) else scene.world
            del scene[TAG]
        else:
            bpy.data.scenes.remove(scene)
    for one in [one for one in _everything() if is_own(one) and one[TAG] != PART]:
        bpy.data.batch_remove([one])
    remove(())
    return stay


def _collection(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    return next((one for one in scene.collection.children if is_own(one)), None)


def _everything() -> list[Any]:
    return [one for kind in _KINDS for one in getattr(bpy.data, kind)]

# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend of a user's own: opened without running anything of it, and what in it is the head."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeAlias

import bpy

from generator.blender.clearing import clear
from generator.errors import HeadError
from generator.escape import quoted

TAG = "headturn_head"
"""Custom property of the object or collection that is the head."""

SURFACES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
SHOWN = 12
"""Names in a message at most."""

Thing: TypeAlias = "bpy.types.Object | bpy.types.Collection"


def open_scene(path: Path, *, whole: bool = True) -> None:
    """Open a .blend as the only data. None of its scripts, handlers and Python drivers runs.

    whole: it is to be rendered, and not only asked what it holds.
    Raises HeadError: it is none, is damaged, or, where whole, was saved by a newer Blender than this one.
    """
    clear()  # preferences of the factory, with no add-on of the user's
    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        said = " ".join(str(error).removeprefix("Error: ").replace(f'"{path}"', "it").split())
        raise HeadError(f"Blender {bpy.app.version_string} cannot open it ({said})") from error
    if whole and bpy.data.version[:2] > bpy.app.version[:2]:
        saved = ".".join(map(str, bpy.data.version[:2]))
        raise HeadError(
            f"saved by Blender {saved}, which {bpy.app.version_string} would read in part; name that one "
            "with --blender, or save it for this one"
        )
    for text in [*bpy.data.texts]:
        text.use_module = False
    layer = next((one for one in bpy.context.scene.view_layers if one.use), bpy.context.scene.view_layers[0])
    for other in [*bpy.context.scene.view_layers]:
        if other != layer:
            bpy.context.scene.view_layers.remove(other)
    layer.use = True


def problems_of_scripts() -> list[str]:
    """What of the open file would be moved by what does not run, in a line."""
    if not bpy.app.autoexec_fail:
        return []
    what = quoted(bpy.app.autoexec_fail_message)
    return [f"its scripts and Python drivers do not run; what they move stands still ({what})"]


def find_head(name: str = "") -> Thing:
    """The object or collection that is the head.

    It is the one of that name; else the one with the custom property TAG; else the only one that could be.
    Raises HeadError, which names those that could, where that is none or several.
    """
    scene = bpy.context.scene
    things: list[Thing] = [*scene.objects, *scene.collection.children_recursive]
    if name:
        named = [thing for thing in things if thing.name == name]
        if not named:
            raise HeadError(f"no object or collection {quoted(name)} in the scene{_could_be()}")
        thing = named[0]
    else:
        tagged = [thing for thing in things if thing.get(TAG)]
        if len(tagged) > 1:
            raise HeadError(f"{listed(thing.name for thing in tagged)} are tagged {TAG}; tag one")
        found = tagged or [*_candidates()]
        if not found:
            raise HeadError("there is no mesh in it that is rendered")
        if len(found) > 1:
            how = f"name it with --head-object, or give it a custom property {TAG}"
            raise HeadError(f"what is the head? {how}{_could_be()}")
        thing = found[0]
    if not any(one.type in SURFACES or one.instance_type == "COLLECTION" for one in objects_of(thing)):
        raise HeadError(f"{quoted(thing.name)} holds no mesh that is rendered{_could_be()}")
    return thing


def objects_of(thing: Thing) -> list[bpy.types.Object]:
    """What turns with the head: it, what is parented to it, and so on."""
    roots = [thing] if isinstance(thing, bpy.types.Object) else [*thing.all_objects]
    found = dict.fromkeys(one for root in roots for one in (root, *root.children_recursive))
    there = {*bpy.context.scene.objects}
    return [one for one in found if one in there]


def shape_keys_of(thing: Thing) -> list[str]:
    """Names of the shape keys of a head that move something by themselves."""
    names: dict[str, None] = {}
    for one in objects_of(thing):
        keys = one.data.shape_keys if one.type == "MESH" else None
        if keys is not None and keys.use_relative:
            names |= dict.fromkeys(
                block.name for block in keys.key_blocks if block != keys.reference_key and not block.mute
            )
    return [*names]


def listed(names: Iterable[str]) -> str:
    """Some names for a message."""
    every = [*names]
    more = f" and {len(every) - SHOWN} more" if len(every) > SHOWN else ""
    return ", ".join(map(quoted, every[:SHOWN])) + more


def _candidates() -> Iterator[bpy.types.Object]:
    """Objects without a parent that are rendered, or carry something that is, as a surface."""
    there, drawn = {*bpy.context.scene.objects}, _drawn()
    for one in bpy.context.scene.objects:
        if one.parent in there:
            continue
        if any(part.type in SURFACES and part in drawn for part in (one, *one.children_recursive)):
            yield one


def _drawn() -> set[bpy.types.Object]:
    """What is rendered of the scene, and in no collection that is left out."""
    waiting, found = [bpy.context.view_layer.layer_collection], set()
    while waiting:
        here = waiting.pop()
        if not here.collection.hide_render:
            waiting += here.children
            if not here.exclude:
                found |= {one for one in here.collection.objects if not one.hide_render}
    return found


def _could_be() -> str:
    names = [one.name for one in _candidates()]
    return f"; there are: {listed(names)}" if names else "; there is no mesh in it that is rendered"

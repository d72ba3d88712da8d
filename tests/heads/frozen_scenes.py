# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes whose head could move by itself, and how each of them turns. For many_scenes.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from generator.blender.scene_head import SceneHead
from generator.blender.scene_mesh import placed_surfaces
from generator.errors import HeadError

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
PIVOT = np.array([0.5, 0.25, 0.0])


def how_they_turn(folder: Path) -> dict[str, dict[str, Any]]:
    """Of each scene: why its head could not be turned by 90 degrees, as error, or what came of it.

    off: how far its surfaces are from where they should be. methods: of displacement, by material.
    axes: of the head, a row an axis of the world.
    """
    scenes = displaced, held, held_inside, linked, instanced, mirrored, simulated
    return {make.__name__: _turned(make, folder) for make in scenes}


def displaced(_: Path) -> None:
    for name in ("Skin", "Ground"):
        thing = _thing(name)
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        nodes = material.node_tree.nodes
        displacement = nodes.new("ShaderNodeDisplacement")
        material.node_tree.links.new(displacement.outputs[0], nodes["Material Output"].inputs["Displacement"])
        material.displacement_method = "BOTH"
        thing.data.materials.append(material)
    bpy.data.objects["Skin"].name = "Head"


def held(_: Path) -> None:
    """Lashes at the corners of a mesh, one of which hangs on something that stays."""
    head, lid, lash, nail = _thing("Head"), _thing("Lid"), _thing("Lash"), bpy.data.objects.new("Nail", None)
    bpy.context.scene.collection.objects.link(nail)
    lid.parent, lash.parent = head, lid
    lid.instance_type = "VERTS"
    hook = lid.modifiers.new("Hook", "HOOK")
    hook.object = nail
    hook.vertex_indices_set([1])


def held_inside(folder: Path) -> None:
    """The same, but what it hangs on is the head's."""
    held(folder)
    bpy.data.objects["Nail"].parent = bpy.data.objects["Head"]


def linked(folder: Path) -> None:
    file = str(_library(folder))  # first: it begins another file
    with bpy.data.libraries.load(file, link=True) as (_, wanted):
        wanted.objects = ["Head", "Eye"]
    for one in wanted.objects:
        bpy.context.scene.collection.objects.link(one)


def instanced(folder: Path) -> None:
    file = str(_library(folder))  # first: it begins another file
    with bpy.data.libraries.load(file, link=True) as (_, wanted):
        wanted.collections = ["Bust"]
    head = bpy.data.objects.new("Head", None)
    head.instance_type, head.instance_collection = "COLLECTION", wanted.collections[0]
    bpy.context.scene.collection.objects.link(head)


def mirrored(_: Path) -> None:
    head = _thing("Head")
    head.scale, head.rotation_euler = (-0.5, 1.0, 2.0), (0.0, 0.0, np.pi / 2)


def simulated(_: Path) -> None:
    head = _thing("Head")
    head.modifiers.new("Hair", "PARTICLE_SYSTEM")
    head.particle_systems[0].settings.type = "HAIR"
    head.particle_systems[0].settings.count = 3
    head.particle_systems[0].use_hair_dynamics = True


def _turned(make: Any, folder: Path) -> dict[str, Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    make(folder)
    file = folder / f"{make.__name__}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    head = SceneHead(file, "Head")
    before = _points(head)
    try:
        head.turn(TURN, PIVOT)
        bpy.context.view_layer.update()
    except HeadError as error:
        return {"error": str(error)}
    off = np.abs(_points(head) - ((before - PIVOT) @ TURN.T + PIVOT)).max()
    methods = {one.name: one.displacement_method for one in bpy.data.materials}
    axes = [[round(x, 6) for x in row[:3]] for row in head.frame[:3]]
    return {"error": "", "problems": head.problems[1:], "off": float(off), "methods": methods, "axes": axes}


def _points(head: SceneHead) -> np.ndarray:
    return np.concatenate([one.vertices for one in placed_surfaces({*head.objects})])


def _library(folder: Path) -> Path:
    """A file with a head and an eye of it, in a collection."""
    file = folder / "library.blend"
    bust, head, eye = bpy.data.collections.new("Bust"), _thing("Head"), _thing("Eye")
    eye.parent = head
    for one in (head, eye):
        bpy.context.scene.collection.objects.unlink(one)
        bust.objects.link(one)
    bpy.data.libraries.write(str(file), {bust}, fake_user=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return file


def _thing(name: str) -> bpy.types.Object:
    data = bpy.data.meshes.new(name)
    data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [], [(0, 1, 2)])
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made

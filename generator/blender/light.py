# SPDX-License-Identifier: GPL-3.0-or-later
"""Key light, surroundings and background. They stand still in the world while the head turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import bpy
from mathutils import Vector

from generator.blender.materials import DIRECTION, STRENGTH, srgb_to_linear
from generator.plan.settings import Look

SUN_DIAMETER = math.radians(25.0)
"""Angular size of the quality preset's lamp: soft-edged shadows, like a large window."""


class Light(Protocol):
    """The light of a stage."""

    def set(self, look: Look) -> None:
        """Make it that of a look."""
        ...


def key_direction(look: Look) -> tuple[float, float, float]:
    """Unit vector from the head to the key light in frame B (x right, y into the scene, z up)."""
    yaw, pitch = math.radians(look.light_yaw_deg), math.radians(look.light_pitch_deg)
    return (
        -math.sin(yaw) * math.cos(pitch),
        -math.cos(yaw) * math.cos(pitch),
        math.sin(pitch),
    )


def build_light(scene: bpy.types.Scene, preset: str, materials: Sequence[bpy.types.Material]) -> Light:
    """World and light of a preset. materials: of the head, which compute the fast preset's light."""
    world = bpy.data.worlds.new("surroundings")
    scene.world = world
    world.use_nodes = True
    # The world is one colour: sampling it as a lamp only adds noise.
    world.cycles.sampling_method = "NONE"
    world.node_tree.nodes.clear()
    return LightInMaterials(world, materials) if preset == "fast" else LightInScene(scene, world)


class LightInMaterials:
    """The fast preset: every material computes light from the normal."""

    def __init__(self, world: bpy.types.World, materials: Sequence[bpy.types.Material]) -> None:
        tree = world.node_tree
        output = tree.nodes.new("ShaderNodeOutputWorld")
        self._background = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(self._background.outputs[0], output.inputs["Surface"])
        self._nodes = [material.node_tree.nodes for material in materials]

    def set(self, look: Look) -> None:
        """See :class:`Light`."""
        self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
        for nodes in self._nodes:
            nodes[DIRECTION].inputs[1].default_value = key_direction(look)
            nodes[STRENGTH].inputs[1].default_value = 1.0 - look.ambient
            nodes[STRENGTH].inputs[2].default_value = look.ambient


class LightInScene:
    """The quality preset: a sun, and white surroundings whatever colour the camera sees behind the head."""

    def __init__(self, scene: bpy.types.Scene, world: bpy.types.World) -> None:
        tree = world.node_tree
        output = tree.nodes.new("ShaderNodeOutputWorld")
        self._background = tree.nodes.new("ShaderNodeBackground")
        self._surroundings = tree.nodes.new("ShaderNodeBackground")
        self._surroundings.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
        path = tree.nodes.new("ShaderNodeLightPath")
        mix = tree.nodes.new("ShaderNodeMixShader")
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        tree.links.new(self._surroundings.outputs[0], mix.inputs[1])
        tree.links.new(self._background.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs["Surface"])
        self._lamp = bpy.data.lights.new("key", "SUN")
        self._lamp.angle = SUN_DIAMETER
        self._key = bpy.data.objects.new("key", self._lamp)
        scene.collection.objects.link(self._key)

    def set(self, look: Look) -> None:
        """See :class:`Light`."""
        self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
        self._surroundings.inputs["Strength"].default_value = look.ambient
        # A sun of strength pi lights a surface that faces it to its own colour.
        self._lamp.energy = math.pi * (1.0 - look.ambient)
        self._key.rotation_euler = Vector(key_direction(look)).to_track_quat("Z", "Y").to_euler()

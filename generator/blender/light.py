# SPDX-License-Identifier: GPL-3.0-or-later
"""Key light, surroundings and background. They stand still in the world while the head turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import bpy
from mathutils import Vector

from generator.blender.environment import set_environment
from generator.blender.materials import DIRECTION, STRENGTH, srgb_to_linear
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

SUN_DIAMETER = math.radians(25.0)
"""Angular size of the quality preset's lamp: soft-edged shadows, like a large window."""


class Light(Protocol):
    """The light of a stage."""

    def add(self, materials: Sequence[bpy.types.Material]) -> None:
        """Light these, too: the fast preset's compute their light."""
        ...

    def drop(self, materials: Sequence[bpy.types.Material]) -> None:
        """No longer."""
        ...

    def set(self, look: Look, environment: EnvironmentLight | None) -> None:
        """Make it that of a look, and of an environment where there is one."""
        ...


def key_direction(look: Look) -> tuple[float, float, float]:
    """Unit vector from the head to the key light in frame B (x right, y into the scene, z up)."""
    yaw, pitch = math.radians(look.light_yaw_deg), math.radians(look.light_pitch_deg)
    return (
        -math.sin(yaw) * math.cos(pitch),
        -math.cos(yaw) * math.cos(pitch),
        math.sin(pitch),
    )


def key_strengths(look: Look, environment: EnvironmentLight | None) -> tuple[float, float]:
    """Strength of the key light, and of white light from everywhere."""
    return (look.environment_key, 0.0) if environment else (1.0 - look.ambient, look.ambient)


def build_light(scene: bpy.types.Scene, preset: str, environment: bool) -> Light:
    """World and light of a preset.

    environment: may it be that of a panorama? In the quality preset it then has to be.
    """
    world = bpy.data.worlds.new("surroundings")
    scene.world = world
    world.use_nodes = True
    # The world is one colour: sampling it as a lamp only adds noise.
    world.cycles.sampling_method = "NONE"
    world.node_tree.nodes.clear()
    if preset == "fast":
        return LightInMaterials(world, environment)
    return LightInScene(scene, world, environment)


class LightInMaterials:
    """The fast preset: every material computes light from the normal."""

    def __init__(self, world: bpy.types.World, environment: bool) -> None:
        tree = world.node_tree
        output = tree.nodes.new("ShaderNodeOutputWorld")
        self._background = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(self._background.outputs[0], output.inputs["Surface"])
        self._materials: list[bpy.types.Material] = []
        self._knows_environments = environment

    def add(self, materials: Sequence[bpy.types.Material]) -> None:
        """See :class:`Light`."""
        self._materials += materials

    def drop(self, materials: Sequence[bpy.types.Material]) -> None:
        """See :class:`Light`."""
        self._materials = [material for material in self._materials if material not in materials]

    def set(self, look: Look, environment: EnvironmentLight | None) -> None:
        """See :class:`Light`."""
        self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
        key, ambient = key_strengths(look, environment)
        for nodes in (material.node_tree.nodes for material in self._materials):
            nodes[DIRECTION].inputs[1].default_value = key_direction(look)
            nodes[STRENGTH].inputs[1].default_value = key
            nodes[STRENGTH].inputs[2].default_value = ambient
        if self._knows_environments:
            set_environment(environment)


class LightInScene:
    """The quality preset: a sun, and surroundings that are white, or a panorama, whatever colour the camera
    sees behind the head."""

    def __init__(self, scene: bpy.types.Scene, world: bpy.types.World, environment: bool) -> None:
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
        self._panorama: Panorama | None = None
        if environment:
            self._panorama = Panorama(tree, self._surroundings.inputs["Color"])
            world.cycles.sampling_method = "MANUAL"  # towards where it is bright
            world.cycles.sample_map_resolution = 512
        self._lamp = bpy.data.lights.new("key", "SUN")
        self._lamp.angle = SUN_DIAMETER
        self._key = bpy.data.objects.new("key", self._lamp)
        scene.collection.objects.link(self._key)

    def add(self, materials: Sequence[bpy.types.Material]) -> None:
        """Lamps light whatever is there."""

    def drop(self, materials: Sequence[bpy.types.Material]) -> None:
        """Lamps light whatever is there."""

    def set(self, look: Look, environment: EnvironmentLight | None) -> None:
        """See :class:`Light`."""
        self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
        key, ambient = key_strengths(look, environment)
        self._surroundings.inputs["Strength"].default_value = environment.scale if environment else ambient
        if self._panorama is not None and environment is not None:
            self._panorama.show(environment)
        # A sun of strength pi lights a surface that faces it to its own colour.
        self._lamp.energy = math.pi * key
        self._key.rotation_euler = Vector(key_direction(look)).to_track_quat("Z", "Y").to_euler()


class Panorama:
    """A panorama as the colour of a world."""

    def __init__(self, tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> None:
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        self._turn = tree.nodes.new("ShaderNodeMapping")
        self._texture = tree.nodes.new("ShaderNodeTexEnvironment")
        tree.links.new(coordinates.outputs["Generated"], self._turn.inputs["Vector"])
        tree.links.new(self._turn.outputs["Vector"], self._texture.inputs["Vector"])
        tree.links.new(self._texture.outputs["Color"], color)

    def show(self, environment: EnvironmentLight) -> None:
        """Turn it as an environment says. Raises RuntimeError if Blender cannot read its file."""
        image = bpy.data.images.load(environment.file, check_existing=True)
        if image.size[0] == 0:
            raise RuntimeError(f"{environment.file}: Blender cannot read this panorama")
        image.colorspace_settings.name = "Linear Rec.709"
        self._texture.image = image
        # Blender has the middle of a panorama at +x, we have it at +y.
        turn = math.radians(environment.turn_deg) - math.pi / 2
        self._turn.inputs["Rotation"].default_value = (0.0, 0.0, turn)

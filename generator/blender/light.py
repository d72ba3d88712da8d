# SPDX-License-Identifier: GPL-3.0-or-later
"""Key light, surroundings and background. They stand still in the world while the head turns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import bpy
from mathutils import Vector

from generator.blender.fast_light import FastLight
from generator.blender.lamps import key_direction, key_strengths, lamp_light
from generator.blender.materials import srgb_to_linear
from generator.blender.needs import Needs, is_layered
from generator.heads.shine import Kinds
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

SUN_DIAMETER = math.radians(25.0)
"""Angular size of the quality preset's lamp: soft-edged shadows, like a large window."""


class Light(Protocol):
    """The light of a stage."""

    def set(
        self, look: Look, environment: EnvironmentLight | None, kinds: Iterable[Kinds]
    ) -> Mapping[Kinds, int]:
        """Make it that of a look, and of an environment where there is one. kinds: of the gloss of each
        object that is seen. Returns where in the maps each of these finds it."""
        ...


def build_light(scene: bpy.types.Scene, needs: Needs, fast: FastLight | None) -> Light:
    """World and light of a stage. fast: what its materials compute; without one they are path traced, and a
    panorama has to light them if they need one."""
    world = bpy.data.worlds.new("surroundings")
    scene.world = world
    world.use_nodes = True
    # The world is one colour: sampling it as a lamp only adds noise.
    world.cycles.sampling_method = "NONE"
    world.node_tree.nodes.clear()
    if fast is not None:
        return LightInMaterials(world, fast)
    return LightInScene(scene, world, needs)


class LightInMaterials:
    """The fast preset: every material computes light from the normal."""

    def __init__(self, world: bpy.types.World, fast: FastLight) -> None:
        tree = world.node_tree
        output = tree.nodes.new("ShaderNodeOutputWorld")
        self._background = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(self._background.outputs[0], output.inputs["Surface"])
        self._fast = fast
        self._color: tuple[float, float, float] | None = None

    def set(
        self, look: Look, environment: EnvironmentLight | None, kinds: Iterable[Kinds]
    ) -> Mapping[Kinds, int]:
        """See :class:`Light`."""
        # Whatever is set in the world, Cycles compiles every material again.
        if not is_layered(look) and look.background != self._color:
            self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
            self._color = look.background
        return self._fast.set(look, environment, kinds)


class LightInScene:
    """The quality preset: suns, and surroundings that are white, or a panorama, whatever colour the camera
    sees behind the head."""

    def __init__(self, scene: bpy.types.Scene, world: bpy.types.World, needs: Needs) -> None:
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
        if needs.environment:
            self._panorama = Panorama(tree, self._surroundings.inputs["Color"])
            world.cycles.sampling_method = "MANUAL"  # towards where it is bright
            world.cycles.sample_map_resolution = 512
        self._key = _sun(scene, "key")
        self._lamps = [_sun(scene, "lamp") for _ in range(needs.lamps)]

    def set(
        self, look: Look, environment: EnvironmentLight | None, kinds: Iterable[Kinds]
    ) -> Mapping[Kinds, int]:
        """See :class:`Light`."""
        self._background.inputs["Color"].default_value = (*srgb_to_linear(look.background), 1.0)
        key, ambient = key_strengths(look, environment)
        self._surroundings.inputs["Strength"].default_value = environment.scale if environment else ambient
        if self._panorama is not None and environment is not None:
            self._panorama.show(environment)
        _shine_from(self._key, key_direction(look), (key, key, key))
        for lamp, given in zip(self._lamps, look.lamps, strict=True):
            _shine_from(lamp, *lamp_light(given))
        return dict.fromkeys(kinds, 0)


def _sun(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    lamp = bpy.data.lights.new(name, "SUN")
    lamp.angle = SUN_DIAMETER
    made = bpy.data.objects.new(name, lamp)
    scene.collection.objects.link(made)
    return made


def _shine_from(sun: bpy.types.Object, direction: Sequence[float], color: Sequence[float]) -> None:
    """direction: to it. color: what it adds to a white surface that faces it; of strength pi it is white."""
    strength = max(color)
    sun.data.energy = math.pi * strength
    sun.data.color = [value / strength if strength else 1.0 for value in color]
    sun.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()


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

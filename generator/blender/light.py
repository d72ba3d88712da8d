# SPDX-License-Identifier: GPL-3.0-or-later
"""Key light and surroundings. They stand still in the world while the head turns."""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

from generator.plan.render_settings import RenderSettings

SUN_DIAMETER = math.radians(25.0)
"""Angular size of the quality preset's lamp: soft-edged shadows, like a large window."""


def key_direction(settings: RenderSettings) -> tuple[float, float, float]:
    """Unit vector from the head to the key light in frame B (x right, y into the scene, z up)."""
    yaw, pitch = math.radians(settings.light_yaw_deg), math.radians(settings.light_pitch_deg)
    return (
        -math.sin(yaw) * math.cos(pitch),
        -math.cos(yaw) * math.cos(pitch),
        math.sin(pitch),
    )


def build_light(scene: bpy.types.Scene, settings: RenderSettings, background: tuple[float, ...]) -> None:
    """World and lamp of the preset. background: linear RGB."""
    world = bpy.data.worlds.new("surroundings")
    scene.world = world
    world.use_nodes = True
    # The world is one colour: sampling it as a lamp only adds noise.
    world.cycles.sampling_method = "NONE"
    tree = world.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputWorld")
    seen = tree.nodes.new("ShaderNodeBackground")
    seen.inputs["Color"].default_value = (*background, 1.0)
    if settings.preset == "fast":
        tree.links.new(seen.outputs[0], output.inputs["Surface"])
        return
    # The camera sees the background; the head is lit by white surroundings whatever its colour.
    lit = tree.nodes.new("ShaderNodeBackground")
    lit.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    lit.inputs["Strength"].default_value = settings.ambient
    path = tree.nodes.new("ShaderNodeLightPath")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(lit.outputs[0], mix.inputs[1])
    tree.links.new(seen.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])

    lamp = bpy.data.lights.new("key", "SUN")
    lamp.angle = SUN_DIAMETER
    # A sun of strength pi lights a surface that faces it to its own colour.
    lamp.energy = math.pi * (1.0 - settings.ambient)
    key = bpy.data.objects.new("key", lamp)
    key.rotation_euler = Vector(key_direction(settings)).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(key)

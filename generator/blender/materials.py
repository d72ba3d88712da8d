# SPDX-License-Identifier: GPL-3.0-or-later
"""The two looks of a head: light from the normal (fast) and path tracing (quality)."""

from __future__ import annotations

from pathlib import Path

import bpy

from generator.blender.environment import environment_group
from generator.blender.nodes import math_node, vector_node
from generator.heads.mesh import Material
from generator.heads.tiling import EXTEND, MIRROR, REPEAT

VERTEX_COLORS = "Color"
UV_MAP = "UVMap"

_EXTENSIONS = {EXTEND: "EXTEND", REPEAT: "REPEAT", MIRROR: "MIRROR"}

DIRECTION, STRENGTH = "direction of the light", "strength of the light"
"""Nodes of the fast preset's materials, which :mod:`generator.blender.light` sets."""


def build_material(
    material: Material, preset: str, *, has_vertex_colors: bool, environment: bool = False
) -> bpy.types.Material:
    """A Blender material with the head's colour and the preset's shading.

    environment: may the light of a panorama be added?
    Raises FileNotFoundError or RuntimeError if the texture cannot be read.
    """
    made = bpy.data.materials.new(material.name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    color, alpha = _base_color(tree, material, has_vertex_colors)
    if preset == "fast":
        # Otherwise Cycles samples every triangle as a lamp: five times the time, same image.
        made.cycles.emission_sampling = "NONE"
        surface = _lit_by_normal(tree, color, environment)
    else:
        surface = _principled(tree, color)
    if material.cutout and alpha is not None:
        surface = _cut_out(tree, surface, alpha)
    if material.opacity < 1:
        surface = _cut_out(tree, surface, _value(tree, material.opacity))
    tree.links.new(surface, output.inputs["Surface"])
    return made


def srgb_to_linear(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """IEC 61966-2-1. Values 0-1."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return r, g, b


def _base_color(
    tree: bpy.types.NodeTree, material: Material, has_vertex_colors: bool
) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket | None]:
    if material.texture is not None:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = _load_image(material.texture)
        node.extension = _EXTENSIONS[material.wrap]
        color = node.outputs["Color"]
        if material.tint != Material.tint:
            color = _times(tree, color, _constant(tree, material.tint))
        if material.vertex_tint:
            color = _times(tree, color, _vertex_colors(tree))
        return color, node.outputs["Alpha"]
    if has_vertex_colors:
        return _vertex_colors(tree), None
    return _constant(tree, srgb_to_linear(material.base_color)), None


def _vertex_colors(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = VERTEX_COLORS
    return node.outputs["Color"]


def _constant(tree: bpy.types.NodeTree, linear: tuple[float, float, float]) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeRGB")
    node.outputs[0].default_value = (*linear, 1.0)
    return node.outputs[0]


def _value(tree: bpy.types.NodeTree, number: float) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeValue")
    node.outputs[0].default_value = number
    return node.outputs[0]


def _times(
    tree: bpy.types.NodeTree, one: bpy.types.NodeSocket, other: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "MULTIPLY"
    tree.links.new(one, node.inputs[0])
    tree.links.new(other, node.inputs[1])
    return node.outputs[0]


def _load_image(path: Path) -> bpy.types.Image:
    image = bpy.data.images.load(str(path), check_existing=True)
    if not image.has_data and image.size[0] == 0:
        raise RuntimeError(f"{path}: Blender cannot read this texture")
    image.alpha_mode = "CHANNEL_PACKED"
    return image


def _lit_by_normal(
    tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, environment: bool
) -> bpy.types.NodeSocket:
    """Emission = colour x (ambient + (1 - ambient) x half-Lambert(normal . light)), or what a panorama gives
    and a share of the key light.

    Half-Lambert (Mitchell et al., "Illustrative rendering in Team Fortress 2",
    2007) keeps the shadow side readable. No ray is traced beyond the first hit,
    so the image has no noise.
    """
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    dot = tree.nodes.new("ShaderNodeVectorMath")
    dot.operation, dot.name = "DOT_PRODUCT", DIRECTION
    tree.links.new(geometry.outputs["Normal"], dot.inputs[0])
    wrapped = math_node(tree, "MULTIPLY_ADD", dot.outputs["Value"], 0.5, 0.5)
    squared = math_node(tree, "MULTIPLY", wrapped, wrapped)
    strength = math_node(tree, "MULTIPLY_ADD", squared)
    strength.node.name = STRENGTH
    emission = tree.nodes.new("ShaderNodeEmission")
    if environment:
        # A product rounds as Blender's own of colour and strength does: without a panorama, the same pixels.
        light = vector_node(tree, "ADD", _environment(tree), strength)
        tree.links.new(_times(tree, color, light), emission.inputs["Color"])
    else:
        tree.links.new(color, emission.inputs["Color"])
        tree.links.new(strength, emission.inputs["Strength"])
    return emission.outputs[0]


def _environment(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = environment_group()
    return node.outputs[0]


def _principled(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    tree.links.new(color, node.inputs["Base Color"])
    # Never the source's own specular: FaceScape's material files say Ks 1, which turns skin to chrome.
    node.inputs["Specular IOR Level"].default_value = 0.25
    node.inputs["Roughness"].default_value = 0.55
    return node.outputs[0]


def _cut_out(
    tree: bpy.types.NodeTree, surface: bpy.types.NodeSocket, alpha: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    hole = tree.nodes.new("ShaderNodeBsdfTransparent")
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(alpha, mix.inputs[0])
    tree.links.new(hole.outputs[0], mix.inputs[1])
    tree.links.new(surface, mix.inputs[2])
    return mix.outputs[0]

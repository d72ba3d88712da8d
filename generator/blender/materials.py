# SPDX-License-Identifier: GPL-3.0-or-later
"""The two looks of a head: light from the normal (fast) and path tracing (quality)."""

from __future__ import annotations

from pathlib import Path

import bpy

from generator.blender.fast_light import FastLight
from generator.blender.label_group import labels_group
from generator.blender.needs import Needs
from generator.blender.nodes import math_node, scaled, vector_node
from generator.blender.skin import Skin, relief
from generator.heads.mesh import HeadMesh, Material
from generator.heads.shine import gloss_of, is_skin, kind_of_gloss
from generator.heads.tiling import EXTEND, MIRROR, REPEAT
from generator.labels import LABELS

VERTEX_COLORS = "Color"
UV_MAP = "UVMap"

_EXTENSIONS = {EXTEND: "EXTEND", REPEAT: "REPEAT", MIRROR: "MIRROR"}

MATT = (0.25, 0.55)
"""Specular level and roughness without gloss. Never the source's own: FaceScape's material files say Ks 1,
which turns skin to chrome."""

GLOSSY, LEAST_ROUGHNESS = 0.35, 0.05
"""Specular level of an index of refraction of 1.4; the roughness of what has all gloss."""

DARKEST_SKIN = 0.03
"""Luminance of the darkest of :data:`generator.heads.parametric.appearance.SKIN_TONES`."""

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear RGB (ITU-R BT.709)."""

CLEAREST = 0.02
"""Opacity of a material that is clearer than that."""

_GLOSS = "headturn_gloss"


LIT, ALBEDO, LABELLED = "lit", "albedo", "labelled"
"""Nodes of what a material may show: itself, its colour alone, or what it is."""


def build_material(
    material: Material, mesh: HeadMesh, fast: FastLight | None, needs: Needs
) -> bpy.types.Material:
    """A Blender material with the head's colour.

    mesh: that it is of. fast: the light of the fast preset, that it computes; without one it is path traced.
    Raises FileNotFoundError or RuntimeError if the texture cannot be read.
    """
    made = bpy.data.materials.new(material.name)
    made[_GLOSS] = kind_of_gloss(material)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    tree.nodes.new("ShaderNodeOutputMaterial")
    color, alpha = _base_color(tree, material, mesh.vertex_colors is not None)
    # Otherwise Cycles samples every triangle as a lamp: five times the time, same image.
    made.cycles.emission_sampling = "NONE"
    skin = relief(tree, color) if needs.relief and is_skin(material) else Skin(color)
    surface = _principled(tree, skin) if fast is None else _lit_by_normal(tree, skin, fast, material, mesh)
    label = _label_color(tree, material)
    for name, lit in ((LIT, surface), (ALBEDO, _emitted(tree, color)), (LABELLED, _emitted(tree, label))):
        if material.cutout and alpha is not None:
            lit = _cut_out(tree, lit, alpha)
        if material.opacity < 1:
            lit = _cut_out(tree, lit, _value(tree, material.opacity))
        lit.node.name = name
    show(made, LIT)
    return made


def show(material: bpy.types.Material, name: str) -> None:
    """Have a material show one of LIT, ALBEDO and LABELLED: that is linked, the others cost nothing."""
    tree = material.node_tree
    [output] = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL"]
    tree.links.new(tree.nodes[name].outputs[0], output.inputs["Surface"])


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
    # Not one that somebody loaded for something else: this one is changed.
    image = next((one for one in bpy.data.images if _is_texture(one, path)), None)
    if image is None:
        image = bpy.data.images.load(str(path))
    if not image.has_data and image.size[0] == 0:
        raise RuntimeError(f"{path}: Blender cannot read this texture")
    image.alpha_mode = "CHANNEL_PACKED"
    return image


def _is_texture(image: bpy.types.Image, path: Path) -> bool:
    return image.filepath == str(path) and image.alpha_mode == "CHANNEL_PACKED"


def set_gloss(made: bpy.types.Material, skin: float) -> None:
    """Give a material that is path traced the gloss that it has where the skin has so much."""
    gloss = gloss_of(made[_GLOSS], skin)
    level, roughness = (GLOSSY, max(LEAST_ROUGHNESS, 1 - gloss)) if gloss else MATT
    [principled] = [node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED"]
    principled.inputs["Specular IOR Level"].default_value = level
    principled.inputs["Roughness"].default_value = roughness


def _emitted(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(color, emission.inputs["Color"])
    return emission.outputs[0]


def _label_color(tree: bpy.types.NodeTree, material: Material) -> bpy.types.NodeSocket:
    """Red, green or blue where the material is one of the three classes that are told apart."""
    if material.label_map is None:
        number = _value(tree, LABELS.index(material.label))
    else:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = _load_image(material.label_map)
        node.image.colorspace_settings.name = "Non-Color"
        node.interpolation, node.extension = "Closest", _EXTENSIONS[material.wrap]
        number = math_node(tree, "MULTIPLY", node.outputs["Color"], 255.0)
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = labels_group()
    tree.links.new(number, group.inputs[0])
    return group.outputs[0]


def _lit_by_normal(
    tree: bpy.types.NodeTree, skin: Skin, fast: FastLight, material: Material, mesh: HeadMesh
) -> bpy.types.NodeSocket:
    """Emission = colour x what a white surface of this normal sends back, and what it mirrors."""
    emission = tree.nodes.new("ShaderNodeEmission")
    lit = fast.into(tree, skin.normal, material, mesh)
    sent = _times(tree, skin.color, lit.light)
    if lit.shine is not None:
        mirrored = lit.shine
        if is_skin(material):
            mirrored = scaled(tree, mirrored, _bareness(tree, skin.color))
        if material.opacity < 1:
            # What is clear mirrors no less: the share that it hides is taken off again below.
            mirrored = _times(tree, mirrored, _value(tree, 1 / max(material.opacity, CLEAREST)))
        sent = vector_node(tree, "ADD", sent, mirrored)
    tree.links.new(sent, emission.inputs["Color"])
    return emission.outputs[0]


def _bareness(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Less than 1 of what is darker than any skin: hair, nostrils and the rims of lids are painted on it."""
    bright = tree.nodes.new("ShaderNodeVectorMath")
    bright.operation = "DOT_PRODUCT"
    tree.links.new(color, bright.inputs[0])
    bright.inputs[1].default_value = [share / DARKEST_SKIN for share in LUMINANCE]
    return math_node(tree, "MINIMUM", bright.outputs["Value"], 1.0)


def _principled(tree: bpy.types.NodeTree, skin: Skin) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    tree.links.new(skin.color, node.inputs["Base Color"])
    if skin.normal is not None:
        tree.links.new(skin.normal, node.inputs["Normal"])
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

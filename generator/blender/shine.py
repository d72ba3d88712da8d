# SPDX-License-Identifier: GPL-3.0-or-later
"""What a glossy surface mirrors in the fast preset: lamps as soft spots, and the surroundings blurred.

A lobe about the mirrored view, exp(s (cosine - 1)) with s = 1 / (2 a^2) for a GGX roughness a, the spherical
Gaussian of Wang et al., "All-frequency rendering of dynamic, spatially-varying reflectance" (SIGGRAPH Asia
2009); it sends back all the light it gets, times Schlick's Fresnel term. No lamp is a point: its own width is
added. The surroundings are the nine terms of their irradiance, of which less is blurred away (Ramamoorthi and
Hanrahan, "A signal-processing framework for reflection", ACM TOG 23(4), 2004).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from generator.blender.environment import form_of, set_form
from generator.blender.nodes import BLACK, math_node, vector_node
from generator.plan.environment_light import EnvironmentLight

FACING = 0.028
"""What a surface mirrors that is seen straight on: an index of refraction of 1.4, of skin and corneas."""

LAMP_WIDTH = 0.012
"""1 / s of a lamp as wide as the quality preset's: a disc of 25 degrees."""

BLURRED = (1.15, 1.7)
"""Of degree 1 and 2 in a lobe as wide as skin's (s about 4), over what irradiance keeps of them."""

_MIRRORED = "mirrored"


def shine(
    tree: bpy.types.NodeTree,
    normal: bpy.types.NodeSocket,
    gloss: bpy.types.NodeSocket,
    lamps: Sequence[str],
    environment: bool,
) -> bpy.types.NodeSocket:
    """Light that a surface mirrors, beside its colour. lamps: names, for :func:`set_lamp`."""
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    view = geometry.outputs["Incoming"]
    # Of a vector towards the viewer this is where the mirrored ray comes from: the reverse of where it goes.
    reverse = tree.nodes.new("ShaderNodeVectorMath")
    reverse.operation = "REFLECT"
    tree.links.new(view, reverse.inputs[0])
    tree.links.new(normal, reverse.inputs[1])
    facing = tree.nodes.new("ShaderNodeVectorMath")
    facing.operation = "DOT_PRODUCT"
    tree.links.new(normal, facing.inputs[0])
    tree.links.new(view, facing.inputs[1])
    roughness = math_node(tree, "SUBTRACT", 1.0, gloss)
    sharpness = _sharpness(tree, roughness)
    minus = math_node(tree, "MULTIPLY", sharpness, -1.0)
    spots: bpy.types.NodeSocket | None = None
    for name in lamps:
        cosine = tree.nodes.new("ShaderNodeVectorMath")
        cosine.operation, cosine.name = "DOT_PRODUCT", f"{_MIRRORED} {name}"
        tree.links.new(reverse.outputs[0], cosine.inputs[0])
        exponent = math_node(tree, "MULTIPLY_ADD", cosine.outputs["Value"], sharpness, minus)
        lobe = math_node(tree, "EXPONENT", exponent)
        spots = vector_node(tree, "MULTIPLY_ADD", lobe, None, spots)
        spots.node.name = f"{_MIRRORED} colour of {name}"
    # A lobe of exp(s (cosine - 1)) holds 2 pi / s; a white surface before a lamp of strength 1 gets pi.
    half = math_node(tree, "MULTIPLY", sharpness, 0.5)
    around = vector_node(tree, "MULTIPLY_ADD", spots, half, None)
    around.node.name = _MIRRORED
    if environment:
        around = vector_node(tree, "ADD", around, form_of(tree, reverse.outputs[0], _MIRRORED))
    return vector_node(tree, "MULTIPLY", around, _share(tree, facing.outputs["Value"], gloss, roughness))


def set_lamp(nodes: bpy.types.Nodes, name: str, direction: Sequence[float], color: Sequence[float]) -> None:
    """direction: unit vector to it. color: what it adds to a white surface that faces it."""
    nodes[f"{_MIRRORED} {name}"].inputs[1].default_value = [-value for value in direction]
    nodes[f"{_MIRRORED} colour of {name}"].inputs[1].default_value = color


def set_surroundings(
    nodes: bpy.types.Nodes, ambient: float, environment: EnvironmentLight | None, form: bool
) -> None:
    """ambient: white light from everywhere. form: are there nodes for an environment?"""
    nodes[_MIRRORED].inputs[2].default_value = (ambient, ambient, ambient)
    if form:
        set_form(nodes, _MIRRORED, mirrored(environment) if environment else None)


def mirrored(light: EnvironmentLight) -> EnvironmentLight:
    """The terms of what a lobe sees in the reverse of its direction: less blurred than irradiance is."""
    first, second = BLURRED
    one, *odd_and_even = np.array(light.terms)
    odd, even = np.array(odd_and_even[:3]), np.array(odd_and_even[3:])
    mean = (even[3] + even[4]) / 3  # of xx and yy, which is no part of degree 2
    terms = np.stack([one + (1 - second) * mean, *(-first * odd), *(second * even)])
    return replace(light, terms=tuple(map(tuple, terms.tolist())), least=BLACK)


def _sharpness(tree: bpy.types.NodeTree, roughness: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """s of the roughness that artists know, whose square is a (Burley, SIGGRAPH 2012)."""
    width = math_node(tree, "MULTIPLY_ADD", math_node(tree, "POWER", roughness, 4.0), 2.0, LAMP_WIDTH)
    return math_node(tree, "DIVIDE", 1.0, width)


def _share(
    tree: bpy.types.NodeTree,
    facing: bpy.types.NodeSocket,
    gloss: bpy.types.NodeSocket,
    roughness: bpy.types.NodeSocket,
) -> bpy.types.NodeSocket:
    """What of the light is mirrored at a cosine towards the viewer; nothing without gloss.

    Schlick's Fresnel term, and his masking (with k = a / 2): what is rough hides itself at its rim.
    """
    away = math_node(tree, "SUBTRACT", 1.0, facing)
    away.node.use_clamp = True
    fresnel = math_node(tree, "MULTIPLY_ADD", math_node(tree, "POWER", away, 5.0), 1 - FACING, FACING)
    k = math_node(tree, "MULTIPLY", math_node(tree, "MULTIPLY", roughness, roughness), 0.5)
    seen = math_node(tree, "MULTIPLY_ADD", facing, math_node(tree, "SUBTRACT", 1.0, k), k)
    masked = math_node(tree, "DIVIDE", math_node(tree, "MULTIPLY", facing, fresnel), seen)
    masked.node.use_clamp = True
    return math_node(tree, "MULTIPLY", masked, math_node(tree, "GREATER_THAN", gloss, 0.0))

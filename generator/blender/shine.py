# SPDX-License-Identifier: GPL-3.0-or-later
"""What a glossy surface mirrors in the fast preset: lamps as soft spots, and the surroundings blurred.

A lobe about the mirrored view, exp(s (cosine - 1)) with s = 1 / (2 a^2) for a GGX roughness a, the spherical
Gaussian of Wang et al., "All-frequency rendering of dynamic, spatially-varying reflectance" (SIGGRAPH Asia
2009); it sends back all the light it gets, times Schlick's Fresnel term. No lamp is a point: its own width is
added. The surroundings are degree 0 and 1 of the terms of their irradiance, of which less is blurred away
(Ramamoorthi and Hanrahan, "A signal-processing framework for reflection", ACM TOG 23(4), 2004).
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from generator.blender.nodes import math_node, scaled, vector_node
from generator.plan.environment_light import EnvironmentLight

FACING = 0.028
"""What a surface mirrors that is seen straight on: an index of refraction of 1.4, of skin and corneas."""

LAMP_WIDTH = 0.012
"""1 / s of a lamp as wide as the quality preset's: a disc of 25 degrees."""

LESS_BLURRED = 1.15
"""What a lobe as wide as skin's (s about 4) keeps of degree 1, over what irradiance does."""

_MIRRORED = "mirrored"


def shine(
    tree: bpy.types.NodeTree,
    normal: bpy.types.NodeSocket,
    gloss: bpy.types.NodeSocket,
    lamps: Sequence[str],
    *,
    environment: bool,
    share: bpy.types.NodeSocket | None,
) -> bpy.types.NodeSocket:
    """Light that a surface mirrors, beside its colour. lamps: names, for :func:`set_lamp`. share: of light
    that is not kept out; None is all."""
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
        # A product by itself: of black, Cycles leaves out all that comes before it.
        spot = vector_node(tree, "MULTIPLY", lobe, None)
        spot.node.name = f"{_MIRRORED} colour of {name}"
        spots = spot if spots is None else vector_node(tree, "ADD", spots, spot)
    # A lobe of exp(s (cosine - 1)) holds 2 pi / s; a white surface before a lamp of strength 1 gets pi.
    half = math_node(tree, "MULTIPLY", sharpness, 0.5)
    around = vector_node(tree, "ADD", None, None)
    around.node.name = _MIRRORED
    if environment:
        combined = tree.nodes.new("ShaderNodeCombineXYZ")
        for color, socket in zip("rgb", combined.inputs, strict=True):
            along = tree.nodes.new("ShaderNodeVectorMath")
            along.operation, along.name = "DOT_PRODUCT", f"{_MIRRORED} {color}"
            tree.links.new(reverse.outputs[0], along.inputs[0])
            tree.links.new(along.outputs["Value"], socket)
        tree.links.new(combined.outputs[0], around.node.inputs[0])
    # A clear mirror shows a few bright things among many dark ones, and no haze.
    haze = math_node(tree, "SUBTRACT", 1.0, math_node(tree, "MULTIPLY", gloss, gloss))
    seen = vector_node(tree, "MULTIPLY_ADD", around, haze, scaled(tree, spots, half))
    mirrored_share = _fresnel(tree, facing.outputs["Value"], gloss)
    if share is not None:
        mirrored_share = math_node(tree, "MULTIPLY", mirrored_share, share)
    return scaled(tree, seen, mirrored_share)


def set_lamp(nodes: bpy.types.Nodes, name: str, direction: Sequence[float], color: Sequence[float]) -> None:
    """direction: unit vector to it. color: what it adds to a white surface that faces it."""
    nodes[f"{_MIRRORED} {name}"].inputs[1].default_value = [-value for value in direction]
    nodes[f"{_MIRRORED} colour of {name}"].inputs[1].default_value = color


def set_surroundings(
    nodes: bpy.types.Nodes, ambient: float, environment: EnvironmentLight | None, varied: bool
) -> None:
    """ambient: white light from everywhere. varied: are there nodes for an environment?

    Of its terms a lobe sees the mean, and more of degree 1 than irradiance has; degree 2 is left out, as most
    of it is of what skin mirrors.
    """
    mean, gradient = np.full(3, ambient), np.zeros((3, 3))
    if environment is not None:
        terms = np.array(environment.terms)
        mean, gradient = mean + terms[0] + (terms[7] + terms[8]) / 3, -LESS_BLURRED * terms[1:4]
    nodes[_MIRRORED].inputs[1].default_value = mean.tolist()
    for color, part in zip("rgb", gradient.T if varied else (), strict=False):
        nodes[f"{_MIRRORED} {color}"].inputs[1].default_value = part.tolist()


def _sharpness(tree: bpy.types.NodeTree, roughness: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """s of the roughness that artists know, whose square is a (Burley, SIGGRAPH 2012)."""
    width = math_node(tree, "MULTIPLY_ADD", math_node(tree, "POWER", roughness, 4.0), 2.0, LAMP_WIDTH)
    return math_node(tree, "DIVIDE", 1.0, width)


def _fresnel(
    tree: bpy.types.NodeTree, facing: bpy.types.NodeSocket, gloss: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """What of the light is mirrored at a cosine towards the viewer; nothing without gloss.

    Schlick's term, that rises to the gloss cubed instead of 1: what is rough hides itself at its rim. All but
    three of the nodes compute constants, which Cycles does beforehand.
    """
    some = math_node(tree, "GREATER_THAN", gloss, 0.0)
    straight = math_node(tree, "MULTIPLY", some, FACING)
    rim = math_node(tree, "MAXIMUM", math_node(tree, "POWER", gloss, 3.0), straight)
    away = math_node(tree, "SUBTRACT", 1.0, facing)
    away.node.use_clamp = True
    rise = math_node(tree, "SUBTRACT", rim, straight)
    return math_node(tree, "MULTIPLY_ADD", math_node(tree, "POWER", away, 5.0), rise, straight)

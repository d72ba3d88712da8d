# SPDX-License-Identifier: GPL-3.0-or-later
"""The relief of skin: furrows of some millimetres down to pores, from noise that sticks to the head.

A noise of three numbers leans the normal, whatever way it faces, as the slopes of such a height would, in a
third of the time. No wave of it is shorter than two pixels: an image of a face from afar has no pores.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy

from generator.blender.nodes import LEAN, OCTAVES, math_node, of_object, scaled, vector_node

LONGEST_MM = 2.5
"""Wavelength of the coarsest waves; each octave halves it."""

MOST_OCTAVES = 3.0
"""Besides the first: down to 0.3 mm, as wide as a pore."""

LEANS = 0.25
"""How far a detail of 1 leans normals, over the noise, whose standard deviation is about 0.15."""

SHADE = 0.1
"""How much darker the bottom of the relief is, over the noise."""


class Skin(NamedTuple):
    """color: darker in the hollows. normal: leaned; None where it is that of the mesh."""

    color: bpy.types.NodeSocket
    normal: bpy.types.NodeSocket | None = None


def relief(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> Skin:
    """Nodes for it in a material; how strong it is says the object, see :func:`relief_of`."""
    place = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.noise_dimensions = "3D"
    noise.inputs["Scale"].default_value = 1000.0 / LONGEST_MM  # Blender counts in metres
    noise.inputs["Roughness"].default_value = 0.75
    tree.links.new(place, noise.inputs["Vector"])
    tree.links.new(of_object(tree, OCTAVES), noise.inputs["Detail"])
    centred = vector_node(tree, "SUBTRACT", noise.outputs["Color"], None)
    centred.node.inputs[1].default_value = (0.5, 0.5, 0.5)
    smooth = tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    lean = of_object(tree, LEAN)
    leaned = vector_node(tree, "ADD", scaled(tree, centred, lean), smooth)
    deep = math_node(tree, "MULTIPLY", math_node(tree, "SUBTRACT", noise.outputs["Fac"], 0.5), lean)
    shade = math_node(tree, "MULTIPLY_ADD", deep, SHADE / LEANS, 1.0)
    return Skin(scaled(tree, color, shade), vector_node(tree, "NORMALIZE", leaned))


def relief_of(detail: float, pixel_mm: float) -> tuple[float, float]:
    """OCTAVES and LEAN of an object. detail: 1 is skin. pixel_mm: what a pixel covers on the head."""
    waves = math.log2(LONGEST_MM / (2 * pixel_mm))
    strength = detail * min(1.0, 2.0 ** min(waves, 0.0))  # what is shorter than two pixels fades
    # Whole octaves: a part of one takes as long as all of it.
    return float(math.floor(min(max(waves, 0.0), MOST_OCTAVES))), LEANS * strength

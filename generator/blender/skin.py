# SPDX-License-Identifier: GPL-3.0-or-later
"""The relief of skin: furrows of some millimetres down to pores, from noise that sticks to the head.

A noise of three numbers leans the normal, whatever way it faces, as the slopes of such a height would, in a
third of the time. No wave of it is shorter than two pixels: an image of a face from afar has no pores.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy

from generator.blender.nodes import math_node, scaled, vector_node

LONGEST_MM = 2.5
"""Wavelength of the coarsest waves; each octave halves it."""

MOST_OCTAVES = 3.0
"""Besides the first: down to 0.3 mm, as wide as a pore."""

LEAN = 0.25
"""How far a detail of 1 leans normals, over the noise, whose standard deviation is about 0.15."""

SHADE = 0.1
"""How much darker the bottom of the relief is, over the noise."""

_NOISE, _LEAN, _SHADE = "relief", "lean of the relief", "shade of the relief"


class Skin(NamedTuple):
    """color: darker in the hollows. normal: leaned; None where it is that of the mesh."""

    color: bpy.types.NodeSocket
    normal: bpy.types.NodeSocket | None = None


def relief(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket) -> Skin:
    """Nodes for it in a material; what they do says :func:`set_relief`."""
    place = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.name, noise.noise_dimensions = _NOISE, "3D"
    noise.inputs["Scale"].default_value = 1000.0 / LONGEST_MM  # Blender counts in metres
    noise.inputs["Roughness"].default_value = 0.75
    tree.links.new(place, noise.inputs["Vector"])
    centred = tree.nodes.new("ShaderNodeVectorMath")
    centred.operation = "SUBTRACT"
    tree.links.new(noise.outputs["Color"], centred.inputs[0])
    centred.inputs[1].default_value = (0.5, 0.5, 0.5)
    smooth = tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    leaned = vector_node(tree, "MULTIPLY_ADD", centred.outputs[0], None, smooth)
    leaned.node.name = _LEAN
    normal = vector_node(tree, "NORMALIZE", leaned)
    shade = math_node(tree, "MULTIPLY_ADD", noise.outputs["Fac"], 0.0, 1.0)
    shade.node.name = _SHADE
    return Skin(scaled(tree, color, shade), normal)


def set_relief(tree: bpy.types.NodeTree, detail: float, pixel_mm: float) -> None:
    """detail: 1 is skin. pixel_mm: what a pixel covers on the head."""
    waves = math.log2(LONGEST_MM / (2 * pixel_mm))
    strength = detail * min(1.0, 2.0 ** min(waves, 0.0))  # what is shorter than two pixels fades
    # Whole octaves: a part of one takes as long as all of it.
    tree.nodes[_NOISE].inputs["Detail"].default_value = float(math.floor(min(max(waves, 0.0), MOST_OCTAVES)))
    lean = LEAN * strength
    tree.nodes[_LEAN].inputs[1].default_value = (lean, lean, lean)
    shade = SHADE * strength
    tree.nodes[_SHADE].inputs[1].default_value = shade
    tree.nodes[_SHADE].inputs[2].default_value = 1.0 - shade / 2


def has_relief(tree: bpy.types.NodeTree) -> bool:
    """Were there nodes made for it?"""
    return _NOISE in tree.nodes

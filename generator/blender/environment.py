# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of an environment in the fast preset: a group of nodes that computes it from the normal."""

from __future__ import annotations

from typing import Any

import bpy

from generator.blender.nodes import BLACK, math_node, vector_node
from generator.plan.environment_light import EnvironmentLight

GROUP = "environment"
LEAST, SUN_DIRECTION, SUN = "least", "direction of the sun", "sun"


def environment_group() -> bpy.types.NodeTree:
    """The group whose output is what a white surface of the normal sends back; made for the first material.

    Of each colour a quadratic form of the normal, its least value, and a sun: see
    generator.picture.irradiance. The form is nested as 1 + x (x + xx x + xy y) + y (y + yy y + yz z) +
    z (z + zx x); each factor is a constant of the node that is named after it. All materials share the
    group: its constants are set once an image.
    """
    made = bpy.data.node_groups.get(GROUP)
    if made is None:
        made = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
        made.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketVector")
        geometry = made.nodes.new("ShaderNodeNewGeometry")
        light = _irradiance(made, geometry.outputs["Normal"])
        made.links.new(light, made.nodes.new("NodeGroupOutput").inputs[0])
    return made


def _irradiance(tree: bpy.types.NodeTree, normal: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(normal, split.inputs[0])
    axis = {}
    for place, name in enumerate("xyz"):
        # Once to a vector: each link from a number would convert it again.
        axis[name] = tree.nodes.new("ShaderNodeCombineXYZ").outputs[0]
        for socket in axis[name].node.inputs:
            tree.links.new(split.outputs[place], socket)

    def term(name: str, by: str, more: bpy.types.NodeSocket | None = None) -> bpy.types.NodeSocket:
        """by x factor + more; without more the sum begins with the factor of `by` itself."""
        made = vector_node(tree, "MULTIPLY_ADD", axis[by], None, more)
        made.node.name = name
        return made

    def under(by: str, inner: bpy.types.NodeSocket, outer: bpy.types.NodeSocket | None) -> Any:
        return vector_node(tree, "MULTIPLY_ADD", axis[by], inner, outer)

    total = under("x", term("xy", "y", term("xx", "x")), None)
    total.node.name = "1"
    total = under("y", term("yz", "z", term("yy", "y")), total)
    total = under("z", term("zx", "x"), total)
    total = vector_node(tree, "MAXIMUM", total, None)
    total.node.name = LEAST
    towards = tree.nodes.new("ShaderNodeVectorMath")
    towards.operation, towards.name = "DOT_PRODUCT", SUN_DIRECTION
    tree.links.new(normal, towards.inputs[0])
    cosine = math_node(tree, "MAXIMUM", towards.outputs["Value"], 0.0)
    total = vector_node(tree, "MULTIPLY_ADD", cosine, None, total)
    total.node.name = SUN
    return total


def set_environment(light: EnvironmentLight | None) -> None:
    """Set the constants of the group; all are zero without an environment."""
    nodes = environment_group().nodes
    terms = light.terms if light else (BLACK,) * 9
    nodes[LEAST].inputs[1].default_value = light.least if light else BLACK
    nodes[SUN_DIRECTION].inputs[1].default_value = light.direction if light else BLACK
    nodes[SUN].inputs[1].default_value = light.sun if light else BLACK
    one, x, y, z, xy, yz, zx, xx, yy = terms
    nodes["1"].inputs[2].default_value = one
    for name, factor, first in (("xx", xx, x), ("yy", yy, y), ("zx", zx, z)):
        nodes[name].inputs[1].default_value, nodes[name].inputs[2].default_value = factor, first
    nodes["xy"].inputs[1].default_value, nodes["yz"].inputs[1].default_value = xy, yz

# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of an environment in the fast preset: nodes that compute it from a direction."""

from __future__ import annotations

from typing import Any

import bpy

from generator.blender.nodes import BLACK, vector_node
from generator.plan.environment_light import EnvironmentLight

LEAST = "least"

Terms = tuple[tuple[float, float, float], ...]
"""Nine RGB, see :class:`generator.plan.environment_light.EnvironmentLight`."""


def form_of(tree: bpy.types.NodeTree, direction: bpy.types.NodeSocket, what: str) -> bpy.types.NodeSocket:
    """Of each colour a quadratic form of a direction, and at least its least value.

    See generator.picture.irradiance. The form is nested as 1 + x (x + xx x + xy y) + y (y + yy y + yz z) +
    z (z + zx x); each factor is a constant of the node that is named after `what` and it.
    """
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(direction, split.inputs[0])
    axis = {}
    for place, name in enumerate("xyz"):
        # Once to a vector: each link from a number would convert it again.
        axis[name] = tree.nodes.new("ShaderNodeCombineXYZ").outputs[0]
        for socket in axis[name].node.inputs:
            tree.links.new(split.outputs[place], socket)

    def term(name: str, by: str, more: bpy.types.NodeSocket | None = None) -> bpy.types.NodeSocket:
        """by x factor + more; without more the sum begins with the factor of `by` itself."""
        made = vector_node(tree, "MULTIPLY_ADD", axis[by], None, more)
        made.node.name = f"{what} {name}"
        return made

    def under(by: str, inner: bpy.types.NodeSocket, outer: bpy.types.NodeSocket | None) -> Any:
        return vector_node(tree, "MULTIPLY_ADD", axis[by], inner, outer)

    total = under("x", term("xy", "y", term("xx", "x")), None)
    total.node.name = f"{what} 1"
    total = under("y", term("yz", "z", term("yy", "y")), total)
    total = under("z", term("zx", "x"), total)
    total = vector_node(tree, "MAXIMUM", total, None)
    total.node.name = f"{what} {LEAST}"
    return total


def set_form(nodes: Any, what: str, light: EnvironmentLight | None) -> None:
    """Set the constants of a form; all are zero without an environment."""
    nodes[f"{what} {LEAST}"].inputs[1].default_value = light.least if light else BLACK
    one, x, y, z, xy, yz, zx, xx, yy = light.terms if light else (BLACK,) * 9
    nodes[f"{what} 1"].inputs[2].default_value = one
    for name, factor, first in (("xx", xx, x), ("yy", yy, y), ("zx", zx, z)):
        node = nodes[f"{what} {name}"]
        node.inputs[1].default_value, node.inputs[2].default_value = factor, first
    for name, factor in (("xy", xy), ("yz", yz)):
        nodes[f"{what} {name}"].inputs[1].default_value = factor

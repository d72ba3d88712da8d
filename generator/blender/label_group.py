# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes as colours: a group of nodes that all materials share, which tells three of them apart."""

from __future__ import annotations

import bpy

from generator.plan.passes import LABELS_A_PICTURE

GROUP = "labels"


def labels_group() -> bpy.types.NodeTree:
    """The group that turns the number of a class into a colour; made for the first material."""
    made = bpy.data.node_groups.get(GROUP)
    if made is not None:
        return made
    made = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
    made.interface.new_socket("Number", in_out="INPUT", socket_type="NodeSocketFloat")
    made.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    number = made.nodes.new("NodeGroupInput").outputs[0]
    combined = made.nodes.new("ShaderNodeCombineColor")
    for place in range(LABELS_A_PICTURE):
        same = made.nodes.new("ShaderNodeMath")
        same.operation, same.name = "COMPARE", str(place)
        made.links.new(number, same.inputs[0])
        same.inputs[2].default_value = 0.5
        made.links.new(same.outputs[0], combined.inputs[place])
    made.links.new(combined.outputs[0], made.nodes.new("NodeGroupOutput").inputs[0])
    return made


def tell_apart(group: int) -> None:
    """Have red, green and blue stand for the three classes of a group."""
    nodes = labels_group().nodes
    for place in range(LABELS_A_PICTURE):
        nodes[str(place)].inputs[1].default_value = LABELS_A_PICTURE * group + place

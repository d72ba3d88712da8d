# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that compute."""

from __future__ import annotations

import bpy

BLACK = (0.0, 0.0, 0.0)


def math_node(
    tree: bpy.types.NodeTree, operation: str, *inputs: bpy.types.NodeSocket | float
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, value in zip(node.inputs, inputs, strict=False):
        if isinstance(value, (int, float)):
            socket.default_value = value
        else:
            tree.links.new(value, socket)
    return node.outputs[0]


def scaled(
    tree: bpy.types.NodeTree, vector: bpy.types.NodeSocket, factor: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """A vector times a number, without a node that makes a vector of the number."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    tree.links.new(vector, node.inputs[0])
    tree.links.new(factor, node.inputs["Scale"])
    return node.outputs[0]


def vector_node(
    tree: bpy.types.NodeTree, operation: str, *inputs: bpy.types.NodeSocket | None
) -> bpy.types.NodeSocket:
    """A node of vectors; what is None stays a constant, zero at first."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    for socket, value in zip(node.inputs, inputs, strict=False):
        if value is None:
            socket.default_value = BLACK
        else:
            tree.links.new(value, socket)
    return node.outputs[0]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that compute."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

BLACK = (0.0, 0.0, 0.0)

CHANNELS = OCTAVES, SHEET, LEAN = "Red", "Green", "Blue"
"""Numbers that are no colour: the colour of an object is what Blender tells its materials without compiling
them again."""


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


def of_object(tree: bpy.types.NodeTree, number: str) -> bpy.types.NodeSocket:
    """OCTAVES, SHEET or LEAN of the object that is seen."""
    split = tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Color"], split.inputs[0])
    return split.outputs[number]


@contextmanager
def apart(tree: bpy.types.NodeTree) -> Iterator[None]:
    """Have a group's outputs unlinked meanwhile: with them Blender tells every material that uses it of every
    number that is set."""
    [out] = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput"]
    links = [(link.from_socket, link.to_socket) for one in out.inputs for link in one.links]
    for _, to in links:
        tree.links.remove(to.links[0])
    try:
        yield
    finally:
        for link in links:
            tree.links.new(*link)

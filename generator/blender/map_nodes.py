# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that look up :mod:`generator.blender.light_maps`: one image of some looks' sheets, one above another.

No number of a node changes from one look to the next, as Blender would compile every material again: in which
row the sheet of an object begins says its colour, and an image holds those of the looks to come.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import bpy
import numpy as np

from generator.blender.light_maps import WIDTH, Light, Tile, draw, layout_of
from generator.blender.nodes import CHANNELS, SHEET, apart, math_node, vector_node
from generator.heads.shine import Kinds, gloss_of
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

STEP, ROWS = 1 / 512, 1 << 14
"""Of a texel, in what is looked up, and the most rows of an image: no more digits than a float32 has, so
that the place of a sheet is added exactly and a look is the same wherever its sheet lies."""

Lit = tuple[Look, EnvironmentLight | None, tuple[Kinds, ...]]
"""What some sheets depend on: one for every kind of object."""


class MapNodes:
    """The image, and the nodes that read it."""

    def __init__(self) -> None:
        self._ahead: list[Lit] = []
        self._sheets: dict[Lit, dict[Kinds, int]] = {}
        self._image: bpy.types.Image | None = None
        self.tree = tree = bpy.data.node_groups.new("light maps", "ShaderNodeTree")
        tree.interface.new_socket("place", in_out="INPUT", socket_type="NodeSocketVector")
        tree.interface.new_socket("color", in_out="OUTPUT", socket_type="NodeSocketVector")
        tree.interface.new_socket("alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
        given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
        inside = vector_node(tree, "SNAP", given[0], None)
        inside.node.inputs[1].default_value = (STEP, STEP, 0.0)
        numbers = tree.nodes.new("ShaderNodeObjectInfo").outputs["Color"]
        upwards = vector_node(tree, "MULTIPLY_ADD", numbers, None, inside)
        upwards.node.inputs[1].default_value = [channel == SHEET for channel in CHANNELS]
        self._size = vector_node(tree, "MULTIPLY", upwards, None).node
        self._texture = tree.nodes.new("ShaderNodeTexImage")
        self._texture.extension = "EXTEND"
        tree.links.new(self._size.outputs[0], self._texture.inputs[0])
        for made, to in zip(self._texture.outputs, out, strict=False):
            tree.links.new(made, to)

    def expect(self, looks: Iterable[Lit]) -> None:
        """What is shown next, in order. Without it the same is shown, but takes longer."""
        self._ahead = list(looks)

    def sheets(
        self, look: Look, environment: EnvironmentLight | None, kinds: tuple[Kinds, ...]
    ) -> dict[Kinds, int]:
        """In which row of the image each kind of object has its sheet; it is made anew if one has none."""
        wanted = look, environment, kinds
        if wanted not in self._sheets:
            there = self._ahead.index(wanted) if wanted in self._ahead else len(self._ahead)
            self._draw(dict.fromkeys([wanted, *self._ahead[there + 1 :]]))
        return self._sheets[wanted]

    def _draw(self, looks: Iterable[Lit]) -> None:
        """The sheets of as many looks as an image holds, one at least."""
        self._sheets = {}
        end = 0
        for lit in looks:
            more = sum(layout_of(kinds).height for kinds in lit[2])
            if self._sheets and end + more > ROWS:
                break
            self._sheets[lit] = {}
            for kinds in lit[2]:
                self._sheets[lit][kinds] = end
                end += layout_of(kinds).height
        height = 1 << (end - 1).bit_length()
        image = bpy.data.images.new("light", WIDTH, height, alpha=True, float_buffer=True, is_data=True)
        image.alpha_mode = "CHANNEL_PACKED"
        texels = np.zeros((height, WIDTH, 4), np.float32)
        for lit, places in self._sheets.items():
            _draw(texels, lit, places)
        image.pixels.foreach_set(texels.ravel())
        with apart(self.tree):
            self._texture.image = image
            self._size.inputs[1].default_value = (1 / WIDTH, 1 / height, 0.0)
        if self._image is not None:
            bpy.data.images.remove(self._image)
        self._image = image

    def look_up(
        self, tree: bpy.types.NodeTree, place: bpy.types.NodeSocket
    ) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
        """Colour and alpha at a place of the sheet, in texels."""
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = self.tree
        tree.links.new(place, node.inputs[0])
        return node.outputs[0], node.outputs[1]


def _draw(texels: np.ndarray, lit: Lit, places: Mapping[Kinds, int]) -> None:
    """The sheet of every kind of object of a look, from the row that it has."""
    look, environment, every = lit
    light = Light(look, environment)
    glosses = {kind: gloss_of(kind, look.gloss) for kinds in every for kind in kinds}
    for kinds, start in places.items():
        layout = layout_of(kinds)
        draw(texels[start : start + layout.height], layout, light, glosses, look.occlusion)


def place_in(
    tree: bpy.types.NodeTree,
    direction: bpy.types.NodeSocket,
    scale: bpy.types.NodeSocket | Tile,
    middle: bpy.types.NodeSocket | None = None,
) -> bpy.types.NodeSocket:
    """Where a direction is in the sheet, in texels. scale: a map, or Tile.scale of one, and Tile.middle."""
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(direction, split.inputs[0])
    angles = tree.nodes.new("ShaderNodeCombineXYZ").outputs[0]
    tree.links.new(math_node(tree, "ARCTAN2", split.outputs[0], split.outputs[1]), angles.node.inputs[0])
    tree.links.new(math_node(tree, "ARCSINE", split.outputs[2]), angles.node.inputs[1])
    if not isinstance(scale, Tile):
        return vector_node(tree, "MULTIPLY_ADD", angles, scale, middle)
    made = vector_node(tree, "MULTIPLY_ADD", angles, None, None)
    made.node.inputs[1].default_value, made.node.inputs[2].default_value = (
        (*scale.scale, 0.0),
        (*scale.middle, 0.0),
    )
    return made

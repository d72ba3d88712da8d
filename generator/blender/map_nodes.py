# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that look up :mod:`generator.blender.light_maps`: one image of some looks' sheets, one above another.

No number of a node changes from one look to the next, as Blender would compile every material again: which
sheet it is says the colour of the object, and an image holds those of the looks to come.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import bpy
import numpy as np

from generator.blender.light_maps import WIDTH, Layout, Light, Tile, drawn
from generator.blender.nodes import SHEET, apart, math_node, of_object, vector_node
from generator.heads.shine import Kind, gloss_of
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

SHEETS = 16
"""In an image, at most: of the looks that are shown next."""

STEP, ROWS = 1 / 512, 1 << 14
"""Of a texel, in what is looked up, and the most rows of an image: no more digits than a float32 has, so
that the place of a sheet is added exactly and a look is the same wherever its sheet lies."""

CLEAR = 0.7
"""Of a gloss above that the highlights are narrower than four texels of a coarse map."""

Lit = tuple[Look, EnvironmentLight | None]
"""What a sheet depends on."""


class MapNodes:
    """The image, and the nodes that read it."""

    def __init__(self) -> None:
        self._layout = Layout()
        self._ahead: list[Lit] = []
        self._sheets: dict[Lit, int] = {}
        self._image: bpy.types.Image | None = None
        self.tree = tree = bpy.data.node_groups.new("light maps", "ShaderNodeTree")
        tree.interface.new_socket("place", in_out="INPUT", socket_type="NodeSocketVector")
        tree.interface.new_socket("color", in_out="OUTPUT", socket_type="NodeSocketVector")
        tree.interface.new_socket("alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
        given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
        inside = vector_node(tree, "SNAP", given[0], None)
        inside.node.inputs[1].default_value = (STEP, STEP, 0.0)
        upwards = tree.nodes.new("ShaderNodeCombineXYZ")
        self._height = math_node(tree, "MULTIPLY", of_object(tree, SHEET), 0.0).node
        tree.links.new(self._height.outputs[0], upwards.inputs[1])
        self._size = vector_node(
            tree, "MULTIPLY", vector_node(tree, "ADD", inside, upwards.outputs[0]), None
        ).node
        self._texture = tree.nodes.new("ShaderNodeTexImage")
        self._texture.extension = "EXTEND"
        tree.links.new(self._size.outputs[0], self._texture.inputs[0])
        for made, to in zip(self._texture.outputs, out, strict=False):
            tree.links.new(made, to)

    def shine(self, kind: Kind) -> Tile:
        """Where is what a kind of gloss mirrors?"""
        if kind not in self._layout.shine:
            self._sheets.clear()
        return self._layout.add(kind, fine=isinstance(kind, str) or kind > CLEAR)

    def expect(self, looks: Iterable[Lit]) -> None:
        """What is shown next, in order. Without it the same is shown, but takes longer."""
        self._ahead = list(looks)

    def sheet(self, look: Look, environment: EnvironmentLight | None) -> int:
        """Which sheet has the light of a look; the image is made anew if none does."""
        wanted = look, environment
        if wanted not in self._sheets:
            there = self._ahead.index(wanted) if wanted in self._ahead else len(self._ahead)
            count = min(SHEETS, max(1, ROWS // self._layout.height))
            self._draw(dict.fromkeys([wanted, *self._ahead[there + 1 : there + count]]))
        return self._sheets[wanted]

    def _draw(self, looks: Mapping[Lit, None]) -> None:
        sheets = []
        for look, environment in looks:
            glosses = {kind: gloss_of(kind, look.gloss) for kind in self._layout.shine}
            sheets.append(drawn(self._layout, Light(look, environment), glosses, look.occlusion))
        rows = np.concatenate(sheets)
        height = 1 << (len(rows) - 1).bit_length()
        image = bpy.data.images.new("light", WIDTH, height, alpha=True, float_buffer=True, is_data=True)
        image.alpha_mode = "CHANNEL_PACKED"
        texels = np.zeros((height, WIDTH, 4), np.float32)
        texels[: len(rows)] = rows
        image.pixels.foreach_set(texels.ravel())
        with apart(self.tree):
            self._texture.image = image
            self._height.inputs[1].default_value = self._layout.height
            self._size.inputs[1].default_value = (1 / WIDTH, 1 / height, 0.0)
        if self._image is not None:
            bpy.data.images.remove(self._image)
        self._image = image
        self._sheets = {look: number for number, look in enumerate(looks)}

    def look_up(
        self, tree: bpy.types.NodeTree, place: bpy.types.NodeSocket
    ) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
        """Colour and alpha at a place of the sheet, in texels."""
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = self.tree
        tree.links.new(place, node.inputs[0])
        return node.outputs[0], node.outputs[1]


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

# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast preset's light: groups of nodes that all materials of a stage share.

No ray is traced beyond the first hit, so the image has no noise.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import bpy

from generator.blender.lamps import key_direction, key_strengths
from generator.blender.light_maps import AMBIENT, DIRECT, FACING
from generator.blender.map_nodes import Lit, MapNodes, place_in
from generator.blender.needs import Needs
from generator.blender.nodes import apart, math_node, scaled, vector_node
from generator.heads.shine import Kind
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

OPENNESS = "openness"
"""Attribute of vertices, see :mod:`generator.landmarks.occlusion`."""

_KEY, _STRENGTH = "key", "strength"


class Sent(NamedTuple):
    """light: what a white surface sends back. shine: what is mirrored, None without gloss."""

    light: bpy.types.NodeSocket
    shine: bpy.types.NodeSocket | None


class FastLight:
    """The light of a stage. A key light alone is computed; all else, and what shines, is looked up."""

    def __init__(self, needs: Needs) -> None:
        self.needs = needs
        self._glossy: dict[bool, bpy.types.NodeTree] = {}
        self._key: bpy.types.NodeTree | None = None

    @cached_property
    def _maps(self) -> MapNodes:
        return MapNodes()

    def into(self, tree: bpy.types.NodeTree, normal: bpy.types.NodeSocket | None, gloss: Kind) -> Sent:
        """What a surface sends back, in the nodes of a material. normal: that of the mesh, if there is no
        other. gloss: what decides it; 0 has none in any look."""
        normal = normal or tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
        node = tree.nodes.new("ShaderNodeGroup")
        if not gloss and not self.needs.maps:
            self._key = self._key or _key_light()
            node.node_tree = self._key
        else:
            node.node_tree = self._looked_up(bool(gloss))
        tree.links.new(normal, node.inputs[0])
        if gloss:
            tile = self._maps.shine(gloss)
            node.inputs[1].default_value, node.inputs[2].default_value = (
                (*tile.scale, 0.0),
                (*tile.middle, 0.0),
            )
        return Sent(node.outputs[0], node.outputs[1] if gloss else None)

    def expect(self, looks: Iterable[Lit]) -> None:
        """What is shown next, in order."""
        if self.needs.maps or self._glossy:
            self._maps.expect(looks)

    def set(self, look: Look, environment: EnvironmentLight | None) -> int:
        """Make it that of a look, and of an environment where there is one; which of the sheets it is."""
        if self._key is not None:
            with apart(self._key):
                nodes = self._key.nodes
                nodes[_STRENGTH].inputs[1].default_value, nodes[_STRENGTH].inputs[2].default_value = (
                    key_strengths(look, environment)
                )
                nodes[_KEY].inputs[1].default_value = key_direction(look)
        return self._maps.sheet(look, environment) if self._glossy else 0

    def _looked_up(self, glossy: bool) -> bpy.types.NodeTree:
        if glossy not in self._glossy:
            self._glossy[glossy] = _looked_up(self._maps, self.needs.occlusion, glossy)
        return self._glossy[glossy]


def _key_light() -> bpy.types.NodeTree:
    """ambient + key x half-Lambert(normal . light), a number.

    Half-Lambert (Mitchell et al., "Illustrative rendering in Team Fortress 2", 2007) keeps the shadow side
    readable.
    """
    tree = _group("key light", glossy=False)
    given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
    dot = tree.nodes.new("ShaderNodeVectorMath")
    dot.operation, dot.name = "DOT_PRODUCT", _KEY
    tree.links.new(given[0], dot.inputs[0])
    wrapped = math_node(tree, "MULTIPLY_ADD", dot.outputs["Value"], 0.5, 0.5)
    light = math_node(tree, "MULTIPLY_ADD", math_node(tree, "MULTIPLY", wrapped, wrapped))
    light.node.name = _STRENGTH
    tree.links.new(light, out[0])
    return tree


def _looked_up(maps: MapNodes, occlusion: bool, glossy: bool) -> bpy.types.NodeTree:
    """ambient (normal) x what is not kept out + direct (normal) x 2 of its square, and what is mirrored.

    Who sees little of the surroundings sees little of a lamp: the aperture of Chan, "Material advances in
    Call of Duty: WWII" (SIGGRAPH 2018), here for lamps in all directions alike.
    """
    tree = _group("looked up", glossy=glossy)
    given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
    place = place_in(tree, given[0], AMBIENT)
    ambient, share = maps.look_up(tree, place)
    beside = vector_node(tree, "ADD", place, None)
    beside.node.inputs[1].default_value = (DIRECT.x - AMBIENT.x, DIRECT.y - AMBIENT.y, 0.0)
    direct, _ = maps.look_up(tree, beside)
    mirrored = _mirrored(tree, maps, given) if glossy else None
    if occlusion:
        vertex = tree.nodes.new("ShaderNodeAttribute")
        vertex.attribute_name = OPENNESS
        closed = math_node(tree, "SUBTRACT", 1.0, vertex.outputs["Fac"])
        left = math_node(tree, "SUBTRACT", 1.0, math_node(tree, "MULTIPLY", share, closed))
        lamps = math_node(tree, "MULTIPLY", math_node(tree, "MULTIPLY", left, left), 2.0)
        lamps.node.use_clamp = True
        ambient, direct = scaled(tree, ambient, left), scaled(tree, direct, lamps)
        mirrored = scaled(tree, mirrored, lamps) if mirrored else None
    tree.links.new(vector_node(tree, "ADD", ambient, direct), out[0])
    if mirrored:
        tree.links.new(mirrored, out[1])
    return tree


def _mirrored(tree: bpy.types.NodeTree, maps: MapNodes, given: bpy.types.NodeInputs) -> bpy.types.NodeSocket:
    """What a surface mirrors: what comes from there, times Schlick's term."""
    view = tree.nodes.new("ShaderNodeNewGeometry").outputs["Incoming"]
    reverse = vector_node(tree, "REFLECT", view, given[0])
    seen, rim = maps.look_up(tree, place_in(tree, reverse, given[1], given[2]))
    facing = tree.nodes.new("ShaderNodeVectorMath")
    facing.operation = "DOT_PRODUCT"
    tree.links.new(given[0], facing.inputs[0])
    tree.links.new(view, facing.inputs[1])
    away = math_node(tree, "SUBTRACT", 1.0, facing.outputs["Value"])
    away.node.use_clamp = True
    rise = math_node(tree, "SUBTRACT", rim, FACING)
    share = math_node(tree, "MULTIPLY_ADD", math_node(tree, "POWER", away, 5.0), rise, FACING)
    return scaled(tree, seen, share)


def _group(name: str, *, glossy: bool) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    for given in ("normal", "scale", "middle") if glossy else ("normal",):
        tree.interface.new_socket(given, in_out="INPUT", socket_type="NodeSocketVector")
    for made in ("light", "shine") if glossy else ("light",):
        tree.interface.new_socket(made, in_out="OUTPUT", socket_type="NodeSocketVector")
    return tree

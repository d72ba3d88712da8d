# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast preset's light: groups of nodes that all materials of a stage share.

No ray is traced beyond the first hit, so the image has no noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import bpy

from generator.blender.lamps import key_direction, key_strengths
from generator.blender.light_maps import ALL, AMBIENT, FACING, layout_of
from generator.blender.map_nodes import Lit, MapNodes, place_in
from generator.blender.needs import Needs
from generator.blender.nodes import apart, math_node, scaled, vector_node
from generator.heads.mesh import HeadMesh, Material
from generator.heads.shine import Kind, Kinds, kind_of_gloss
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
        self._groups: dict[tuple[bool, bool], bpy.types.NodeTree] = {}
        self._key: bpy.types.NodeTree | None = None

    @cached_property
    def _maps(self) -> MapNodes:
        return MapNodes()

    def kinds(self, materials: Sequence[Material]) -> Kinds:
        """Those of the gloss that they have in some look."""
        every = dict.fromkeys(self._kind(material) for material in materials)
        return tuple(kind for kind in every if kind)

    def into(
        self,
        tree: bpy.types.NodeTree,
        normal: bpy.types.NodeSocket | None,
        material: Material,
        mesh: HeadMesh,
    ) -> Sent:
        """What a surface sends back, in the nodes of a material. normal: that of the mesh, if there is no
        other."""
        gloss = self._kind(material)
        normal = normal or tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
        node = tree.nodes.new("ShaderNodeGroup")
        if not gloss and not self.needs.maps:
            self._key = self._key or _key_light()
            node.node_tree = self._key
        else:
            # What nobody cast rays for is open.
            closed = self.needs.occlusion and mesh.openness is not None
            node.node_tree = self._looked_up(closed, bool(gloss))
        tree.links.new(normal, node.inputs[0])
        if gloss:
            tile = layout_of(self.kinds(mesh.materials)).shine[gloss]
            node.inputs[1].default_value, node.inputs[2].default_value = (
                (*tile.scale, 0.0),
                (*tile.middle, 0.0),
            )
        return Sent(node.outputs[0], node.outputs[1] if gloss else None)

    def expect(self, looks: Iterable[Lit]) -> None:
        """What is shown next, in order."""
        if self.needs.maps or self._groups:
            self._maps.expect(looks)

    def set(
        self, look: Look, environment: EnvironmentLight | None, kinds: Iterable[Kinds]
    ) -> Mapping[Kinds, int]:
        """Make it that of a look, and of an environment where there is one. kinds: of each object that is
        seen. Returns where each of these has its sheet."""
        if self._key is not None:
            with apart(self._key):
                nodes = self._key.nodes
                nodes[_STRENGTH].inputs[1].default_value, nodes[_STRENGTH].inputs[2].default_value = (
                    key_strengths(look, environment)
                )
                nodes[_KEY].inputs[1].default_value = key_direction(look)
        each = tuple(dict.fromkeys(kinds))
        return self._maps.sheets(look, environment, each) if self._groups else dict.fromkeys(each, 0)

    def _kind(self, material: Material) -> Kind:
        """What decides a gloss; 0 where there is none in any look."""
        kind = kind_of_gloss(material)
        return 0.0 if isinstance(kind, str) and not self.needs.gloss else kind

    def _looked_up(self, closed: bool, glossy: bool) -> bpy.types.NodeTree:
        if (closed, glossy) not in self._groups:
            self._groups[closed, glossy] = _looked_up(self._maps, closed, glossy)
        return self._groups[closed, glossy]


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


def _looked_up(maps: MapNodes, closed: bool, glossy: bool) -> bpy.types.NodeTree:
    """ambient (normal) x what is not kept out + direct (normal) x 2 of its square, and what is mirrored.

    closed: is anything kept out? Who sees little of the surroundings sees little of a lamp: the aperture of
    Chan, "Material advances in Call of Duty: WWII" (SIGGRAPH 2018), here for lamps in all directions alike.
    """
    tree = _group("looked up", glossy=glossy)
    given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
    place = place_in(tree, given[0], ALL)
    light, _ = maps.look_up(tree, place)
    mirrored = _mirrored(tree, maps, given) if glossy else None
    if closed:
        beside = vector_node(tree, "ADD", place, None)
        beside.node.inputs[1].default_value = (AMBIENT.x - ALL.x, AMBIENT.y - ALL.y, 0.0)
        ambient, share = maps.look_up(tree, beside)
        vertex = tree.nodes.new("ShaderNodeAttribute")
        vertex.attribute_name = OPENNESS
        kept_out = math_node(tree, "SUBTRACT", 1.0, vertex.outputs["Fac"])
        left = math_node(tree, "SUBTRACT", 1.0, math_node(tree, "MULTIPLY", share, kept_out))
        lamps = math_node(tree, "MULTIPLY", math_node(tree, "MULTIPLY", left, left), 2.0)
        lamps.node.use_clamp = True
        # The light is ambient and direct: ambient x left + (light - ambient) x lamps.
        more = scaled(tree, ambient, math_node(tree, "SUBTRACT", left, lamps))
        light = vector_node(tree, "ADD", scaled(tree, light, lamps), more)
        mirrored = scaled(tree, mirrored, lamps) if mirrored else None
    tree.links.new(light, out[0])
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

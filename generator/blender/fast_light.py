# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast preset's light: groups of nodes that all materials of a stage share, set once an image.

No ray is traced beyond the first hit, so the image has no noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import bpy

from generator.blender.environment import form_of, set_form
from generator.blender.lamps import key_direction, key_strengths, lamp_light
from generator.blender.needs import Needs
from generator.blender.nodes import BLACK, math_node, scaled, vector_node
from generator.blender.shine import set_lamp, set_surroundings, shine
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

LIGHT = "light"
"""Output of the group: what a white surface sends back."""

SHINE = "shine"
"""Output of the group: what a surface mirrors, whatever its colour."""

NORMAL, GLOSS = "normal", "gloss"
"""Inputs of the group."""

OPENNESS = "openness"
"""Attribute of vertices, see :mod:`generator.landmarks.occlusion`."""

_KEY, _STRENGTH, _AMBIENT, _OPENNESS = "key", "strength", "ambient", "occlusion"
_IRRADIANCE, _SUN, _COLOR = "irradiance", "sun", "colour of "

Color = tuple[float, float, float]


class Lit(NamedTuple):
    """light: what a white surface sends back. shine: what is mirrored, None without gloss."""

    light: bpy.types.NodeSocket
    shine: bpy.types.NodeSocket | None


class FastLight:
    """The light of a stage: with nodes for what it needs, and no others, but for what glossy materials need.

    Whatever a stage has nodes for beyond what a look needs changes no pixel: a factor is then 1, a summand 0.
    """

    def __init__(self, needs: Needs) -> None:
        self.needs = needs
        self._groups: dict[bool, _Group] = {}

    def into(self, tree: bpy.types.NodeTree, normal: bpy.types.NodeSocket | None, glossy: bool) -> Lit:
        """What a surface sends back, in the nodes of a material. normal: that of the mesh, if there is no
        other. glossy: it has a gloss, in some look."""
        if glossy not in self._groups:
            self._groups[glossy] = _Group(self.needs, glossy)
        normal = normal or tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree, node.name = self._groups[glossy].tree, LIGHT
        tree.links.new(normal, node.inputs[NORMAL])
        return Lit(node.outputs[LIGHT], node.outputs[SHINE] if glossy else None)

    def set(self, look: Look, environment: EnvironmentLight | None) -> None:
        """Make it that of a look, and of an environment where there is one."""
        for group in self._groups.values():
            group.set(look, environment)


class _Group:
    """The nodes. glossy: with those for what a surface mirrors."""

    def __init__(self, needs: Needs, glossy: bool) -> None:
        self._needs, self._glossy = needs, glossy
        self._lamps = tuple(f"lamp {k}" for k in range(needs.lamps))
        self.tree = tree = bpy.data.node_groups.new(LIGHT, "ShaderNodeTree")
        tree.interface.new_socket(NORMAL, in_out="INPUT", socket_type="NodeSocketVector")
        tree.interface.new_socket(LIGHT, in_out="OUTPUT", socket_type="NodeSocketVector")
        if glossy:
            tree.interface.new_socket(GLOSS, in_out="INPUT", socket_type="NodeSocketFloat")
            tree.interface.new_socket(SHINE, in_out="OUTPUT", socket_type="NodeSocketVector")
        given, out = tree.nodes.new("NodeGroupInput").outputs, tree.nodes.new("NodeGroupOutput").inputs
        shares = _shares(tree) if needs.occlusion else None
        light = _key_light(tree, given[NORMAL], shares)
        if needs.environment:
            light = _environment_light(tree, given[NORMAL], shares, light)
        for name in self._lamps:
            # Each by itself: of black, Cycles leaves out all that comes before it.
            light = vector_node(tree, "ADD", light, _lamp(tree, given[NORMAL], shares, name))
        tree.links.new(light, out[LIGHT])
        if glossy:
            suns = (_SUN,) if needs.environment else ()
            seen = shine(
                tree,
                given[NORMAL],
                given[GLOSS],
                (_KEY, *suns, *self._lamps),
                environment=needs.environment,
                share=shares.direct if shares else None,
            )
            tree.links.new(seen, out[SHINE])

    def set(self, look: Look, environment: EnvironmentLight | None) -> None:
        """See :class:`FastLight`."""
        with _apart(self.tree):
            self._set(look, environment)

    def _set(self, look: Look, environment: EnvironmentLight | None) -> None:
        nodes = self.tree.nodes
        key, ambient = key_strengths(look, environment)
        nodes[_STRENGTH].inputs[1].default_value = key
        nodes[_KEY].inputs[1].default_value = key_direction(look)
        self._mirror(_KEY, key_direction(look), (key, key, key))
        if self._needs.occlusion:
            nodes[_OPENNESS].inputs[1].default_value = look.occlusion
            nodes[_OPENNESS].inputs[2].default_value = 1.0 - look.occlusion
            nodes[_AMBIENT].inputs[1].default_value = ambient
        else:
            nodes[_STRENGTH].inputs[2].default_value = ambient
        if self._needs.environment:
            set_form(nodes, _IRRADIANCE, environment)
            sun = (environment.direction, environment.sun) if environment else (BLACK, BLACK)
            self._set_lamp(_SUN, *sun)
        dark = [(BLACK, BLACK)] * len(self._lamps)
        for name, lamp in zip(self._lamps, [*map(lamp_light, look.lamps), *dark], strict=False):
            self._set_lamp(name, *lamp)
        if self._glossy:
            set_surroundings(nodes, ambient, environment, self._needs.environment)

    def _set_lamp(self, name: str, direction: Color, color: Color) -> None:
        self.tree.nodes[name].inputs[1].default_value = direction
        self.tree.nodes[_COLOR + name].inputs[1].default_value = color
        self._mirror(name, direction, color)

    def _mirror(self, name: str, direction: Color, color: Color) -> None:
        if self._glossy:
            set_lamp(self.tree.nodes, name, direction, color)


@contextmanager
def _apart(tree: bpy.types.NodeTree) -> Iterator[None]:
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


class _Shares(NamedTuple):
    """What of ambient and of direct light is not kept out."""

    ambient: bpy.types.NodeSocket
    direct: bpy.types.NodeSocket


def _shares(tree: bpy.types.NodeTree) -> _Shares:
    """1 - occlusion (1 - openness), and 2 of its square.

    Who sees little of the surroundings sees little of a lamp: the aperture of Chan, "Material advances in
    Call of Duty: WWII" (SIGGRAPH 2018), here for lamps in all directions alike.
    """
    vertex = tree.nodes.new("ShaderNodeAttribute")
    vertex.attribute_name = OPENNESS
    ambient = math_node(tree, "MULTIPLY_ADD", vertex.outputs["Fac"])
    ambient.node.name = _OPENNESS
    direct = math_node(tree, "MULTIPLY", math_node(tree, "MULTIPLY", ambient, ambient), 2.0)
    direct.node.use_clamp = True
    return _Shares(ambient, direct)


def _key_light(
    tree: bpy.types.NodeTree, normal: bpy.types.NodeSocket, shares: _Shares | None
) -> bpy.types.NodeSocket:
    """ambient + key x half-Lambert(normal . light), a number.

    Half-Lambert (Mitchell et al., "Illustrative rendering in Team Fortress 2", 2007) keeps the shadow side
    readable.
    """
    dot = _towards(tree, normal, _KEY)
    wrapped = math_node(tree, "MULTIPLY_ADD", dot, 0.5, 0.5)
    squared = math_node(tree, "MULTIPLY", wrapped, wrapped)
    if shares is None:
        light = math_node(tree, "MULTIPLY_ADD", squared)
    else:
        ambient = math_node(tree, "MULTIPLY", shares.ambient)
        ambient.node.name = _AMBIENT
        squared = math_node(tree, "MULTIPLY", squared, shares.direct)
        light = math_node(tree, "MULTIPLY_ADD", squared, 1.0, ambient)
    light.node.name = _STRENGTH
    return light


def _environment_light(
    tree: bpy.types.NodeTree,
    normal: bpy.types.NodeSocket,
    shares: _Shares | None,
    more: bpy.types.NodeSocket,
) -> bpy.types.NodeSocket:
    """That of a panorama, and its sun, and more."""
    light = form_of(tree, normal, _IRRADIANCE)
    if shares is not None:
        light = scaled(tree, light, shares.ambient)
    return vector_node(tree, "ADD", _lamp(tree, normal, shares, _SUN, light), more)


def _lamp(
    tree: bpy.types.NodeTree,
    normal: bpy.types.NodeSocket,
    shares: _Shares | None,
    name: str,
    more: bpy.types.NodeSocket | None = None,
) -> bpy.types.NodeSocket:
    """That of a lamp, and more."""
    cosine = math_node(tree, "MAXIMUM", _towards(tree, normal, name), 0.0)
    if shares is not None:
        cosine = math_node(tree, "MULTIPLY", cosine, shares.direct)
    if more is None:
        light = vector_node(tree, "MULTIPLY", cosine, None)
    else:
        light = vector_node(tree, "MULTIPLY_ADD", cosine, None, more)
    light.node.name = _COLOR + name
    return light


def _towards(tree: bpy.types.NodeTree, direction: bpy.types.NodeSocket, name: str) -> bpy.types.NodeSocket:
    """The cosine of a direction with the constant of a node of that name."""
    dot = tree.nodes.new("ShaderNodeVectorMath")
    dot.operation, dot.name = "DOT_PRODUCT", name
    tree.links.new(direction, dot.inputs[0])
    return dot.outputs["Value"]

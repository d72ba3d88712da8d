# SPDX-License-Identifier: GPL-3.0-or-later
"""What one can see through in a scene, and what colour the rest is: followed from a material's output."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import bpy

SEE_THROUGH = 0.5
"""A surface that lets more light through than that is none that landmarks lie on or behind."""

CLEAR = {"BSDF_GLASS", "BSDF_TRANSPARENT", "BSDF_REFRACTION"}
GLOSS = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC"}
"""Of a pane of glass, too: by themselves they hide, beside what is clear they do not."""

DEEP = 64
"""Nodes one after another that are followed."""

Groups: TypeAlias = "tuple[bpy.types.Node, ...]"
"""The nodes of groups that a node lies in, the outermost first."""


@dataclass(frozen=True)
class Holes:
    """An image that makes holes: channel 3 is its alpha. inverted: there is a hole where it is white."""

    image: bpy.types.Image
    channel: int
    inverted: bool = False


@dataclass(frozen=True)
class Shading:
    """What a material lets through.

    clear: one sees through it. cut: nothing is drawn where it is, and what is behind is hidden. holes: where
    it is not there. known: False where that varies in a way that is not followed; it counts as solid.
    """

    clear: bool = False
    cut: bool = False
    holes: Holes | None = None
    known: bool = True


_Value: TypeAlias = "float | Holes | None"


def shading_of(one: bpy.types.Material | None) -> Shading:
    """What is to be known of a material."""
    output = _output(one)
    if output is None:
        return Shading()
    if not output.inputs["Surface"].is_linked:
        return Shading(clear=output.inputs["Volume"].is_linked)
    found = _shader(output.inputs["Surface"], (), DEEP)
    return Shading(clear=found == "gloss") if isinstance(found, str) else found


def inputs_of(one: bpy.types.Material, *names: str) -> Iterator[tuple[bpy.types.NodeSocket, Groups]]:
    """Inputs of these names of the shaders that a material is made of, name after name."""
    output = _output(one)
    if output is None:
        return
    found = [
        (node, groups)
        for node, groups in _behind(output.inputs["Surface"], ())
        if node.type.startswith(("BSDF", "EMISSION", "SUBSURFACE"))
    ]
    for name in names:
        yield from ((node.inputs[name], groups) for node, groups in found if name in node.inputs)


def image_behind(
    socket: bpy.types.NodeSocket, groups: Groups
) -> tuple[bpy.types.Image, bpy.types.NodeSocket] | None:
    """The first image that an input comes from, and which output of its node."""
    for node, _, out in _reached(socket, groups):
        if node.type == "TEX_IMAGE" and node.image is not None and node.image.source != "TILED":
            return node.image, out
    return None


def _output(one: bpy.types.Material | None) -> bpy.types.Node | None:
    if one is None or not one.use_nodes or one.node_tree is None:
        return None
    return one.node_tree.get_output_node("CYCLES")


def _source(socket: bpy.types.NodeSocket, groups: Groups) -> tuple[bpy.types.NodeSocket, Groups] | None:
    """The output that an input comes from, in whichever group; None, or an input, where nothing is linked."""
    for _ in range(DEEP):
        if not socket.is_output:
            links = [link for link in socket.links if link.is_valid and not link.is_muted]
            if not links:
                return socket, groups
            socket = links[0].from_socket
        node = socket.node
        if node.mute:
            inner = [link.from_socket for link in node.internal_links if link.to_socket == socket]
            if not inner:
                return None
            socket = inner[0]
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP" and node.node_tree is not None:
            ends = [one for one in node.node_tree.nodes if one.type == "GROUP_OUTPUT"]
            end = next((one for one in ends if one.is_active_output), None)
            named = [] if end is None else [k for k in end.inputs if k.identifier == socket.identifier]
            if not named:
                return None
            socket, groups = named[0], (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            named = [k for k in groups[-1].inputs if k.identifier == socket.identifier]
            if not named:
                return None
            socket, groups = named[0], groups[:-1]
        else:
            return socket, groups
    return None


def _reached(
    socket: bpy.types.NodeSocket, groups: Groups
) -> Iterator[tuple[bpy.types.Node, Groups, bpy.types.NodeSocket]]:
    """Nodes that an input comes from, the nearest first, in which groups, and by which output."""
    waiting, seen = [(socket, groups)], set()
    while waiting:
        source = _source(*waiting.pop(0))
        if source is None or not source[0].is_output:
            continue
        out, inside = source
        key = out.node.name, tuple(one.name for one in inside)
        if key in seen:
            continue
        seen.add(key)
        yield out.node, inside, out
        waiting += [(one, inside) for one in out.node.inputs]


def _behind(socket: bpy.types.NodeSocket, groups: Groups) -> Iterator[tuple[bpy.types.Node, Groups]]:
    for node, inside, _ in _reached(socket, groups):
        yield node, inside


def _shader(socket: bpy.types.NodeSocket, groups: Groups, left: int) -> Shading | str:
    """What the shader that an input comes from lets through; "gloss" where it depends on what is beside."""
    source = _source(socket, groups)
    if source is None or not source[0].is_output or not left:
        return Shading()
    node, groups = source[0].node, source[1]
    if node.type in GLOSS:
        return "gloss"
    if node.type in CLEAR or node.type == "HOLDOUT":
        return Shading(clear=node.type in CLEAR, cut=node.type == "HOLDOUT")
    if node.type == "BSDF_PRINCIPLED":
        return _principled(node, groups)
    if node.type == "MIX_SHADER":
        both = [_shader(one, groups, left - 1) for one in node.inputs[1:3]]
        return _mixed(_value(node.inputs[0], groups), *both)
    if node.type == "ADD_SHADER":
        both = [_shader(one, groups, left - 1) for one in node.inputs]
        return next((one for one in both if isinstance(one, Shading) and one.clear), both[0])
    return Shading()


def _principled(node: bpy.types.Node, groups: Groups) -> Shading:
    weight = node.inputs.get("Transmission Weight")
    passes = 0.0 if weight is None else _value(weight, groups)
    alpha = _value(node.inputs["Alpha"], groups)
    if isinstance(passes, float) and passes > SEE_THROUGH:
        return Shading(clear=True)
    known = isinstance(passes, float) and alpha is not None
    if isinstance(alpha, Holes):
        return Shading(holes=alpha, known=known)
    return Shading(clear=alpha is not None and alpha <= SEE_THROUGH, known=known)


def _mixed(share: _Value, first: Shading | str, second: Shading | str) -> Shading | str:
    """share: of the second."""
    if share == 0.0 or first == second:
        return first
    if share == 1.0:
        return second
    if isinstance(first, str) or isinstance(second, str):
        return second if isinstance(first, str) else first
    if isinstance(share, float):
        more = second if share >= SEE_THROUGH else first
        return more
    if isinstance(share, Holes) and first.clear != second.clear:
        return Shading(holes=Holes(share.image, share.channel, share.inverted != second.clear))
    return Shading(
        clear=first.clear and second.clear,
        cut=first.cut and second.cut,
        holes=first.holes or second.holes,
        known=first.known and second.known and first.clear == second.clear,
    )


def _value(socket: bpy.types.NodeSocket, groups: Groups) -> _Value:
    """A number, or the image that it comes from; None where it is neither. For a ray of the camera."""
    source = _source(socket, groups)
    if source is None:
        return None
    out, inside = source
    if not out.is_output:
        value = getattr(out, "default_value", None)
        return float(value) if isinstance(value, int | float) else None
    node = out.node
    if node.type == "VALUE":
        return float(out.default_value)
    if node.type == "LIGHT_PATH" and out.name.startswith("Is "):
        return float(out.name == "Is Camera Ray")
    found = image_behind(socket, groups)
    if found is None:
        return None
    return Holes(found[0], 3 if found[1].name == "Alpha" else 0, _is_inverted(node, inside))


def _is_inverted(node: bpy.types.Node, groups: Groups) -> bool:
    """Does a node make white of black: 1 - x, x < t, or an Invert?"""
    if node.type == "INVERT":
        return True
    if node.type != "MATH" or node.operation not in ("SUBTRACT", "LESS_THAN"):
        return False
    number = _value(node.inputs[0], groups)
    return isinstance(number, float) == (node.operation == "SUBTRACT")

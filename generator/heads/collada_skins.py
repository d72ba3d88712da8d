# SPDX-License-Identifier: GPL-3.0-or-later
"""The shapes that a Collada scene shows: meshes as they stand, morphed, or moved by a skeleton."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from generator.heads.collada_file import Document, inputs, numbers, text
from generator.heads.collada_nodes import Instance, Nodes
from generator.heads.limits import MAX_DEPTH, MAX_MOVES, MAX_NODES, MAX_VERTICES, check_count

_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class Shape:
    """mesh: its element. positions: float64 [V, 3], where its vertices are. mirrored: bool [V], where what
    moved them there turns the inside out."""

    mesh: Element
    positions: np.ndarray
    mirrored: np.ndarray


class Shapes:
    """What instances show, in the scene's frame. Its methods raise as :class:`Document` does."""

    def __init__(self, document: Document, nodes: Nodes) -> None:
        self._document, self._nodes = document, nodes
        self._vertices = self._moves = 0

    def of(self, instance: Instance) -> Shape | None:
        """None of what has no polygons, such as a spline."""
        element = self._document.target(instance.element.get("url"))
        skin = element.find("skin")
        if skin is None:
            found = self._still(element, 0)
            if found is None:
                return None
            mesh, positions = found
            linear = instance.world[:3, :3]
            moved = positions @ linear.T + instance.world[:3, 3]
            return Shape(mesh, moved, np.full(len(moved), np.linalg.det(linear) < 0))
        found = self._still(self._document.target(skin.get("source")), 0)
        return None if found is None else self._skinned(skin, *found, instance.element)

    def _still(self, element: Element, depth: int) -> tuple[Element, np.ndarray] | None:
        """A mesh, morphed by its default weights, where it is stored."""
        check_count(depth, MAX_DEPTH, "controllers within each other")
        morph = element.find("morph")
        if morph is not None:
            base = self._still(self._document.target(morph.get("source")), depth + 1)
            return None if base is None else (base[0], self._morphed(morph, base[1], depth))
        mesh = element.find("mesh")
        if mesh is None:
            return None
        positions = next((uri for kind, _, _, uri in inputs(_vertices(mesh)) if kind == "POSITION"), None)
        table = self._document.table(self._document.target(positions))
        if table.shape[1] != 3:
            raise ValueError("positions have no three coordinates")
        self._vertices += len(table)
        check_count(self._vertices, 4 * MAX_VERTICES, "vertices of shapes and what they become")
        return mesh, table

    def _morphed(self, morph: Element, base: np.ndarray, depth: int) -> np.ndarray:
        sources = {
            kind: self._document.target(uri) for kind, _, _, uri in inputs(_needed(morph.find("targets")))
        }
        names = self._document.words(sources["MORPH_TARGET"])
        weights = self._document.table(sources["MORPH_WEIGHT"])[:, 0]
        relative = morph.get("method", "NORMALIZED") == "RELATIVE"
        moved = base * (1.0 if relative else 1.0 - weights.sum())
        for name, weight in zip(names, weights, strict=True):
            target = self._still(self._document.target(f"#{name}"), depth + 1) if weight else None
            if target is not None:
                moved = moved + weight * target[1]
        return moved

    def _skinned(self, skin: Element, mesh: Element, stored: np.ndarray, instance: Element) -> Shape:
        """Linear blend skinning: only the joints say where the mesh is."""
        bind = numbers(skin.find("bind_shape_matrix"))
        if len(bind):
            matrix = bind.reshape(4, 4)
            stored = stored @ matrix[:3, :3].T + matrix[:3, 3]
        else:
            matrix = np.eye(4)
        joints = {kind: uri for kind, _, _, uri in inputs(_needed(skin.find("joints")))}
        names = self._document.words(self._document.target(joints["JOINT"]))
        check_count(len(names), MAX_NODES, "joints")
        inverse = self._document.table(self._document.target(joints["INV_BIND_MATRIX"])).reshape(-1, 4, 4)
        roots = [self._document.target(text(entry)) for entry in instance.iter("skeleton")]
        places = np.stack([self._nodes.world_of(node) for node in self._joints(names, roots)])
        # The last is for what no joint moves.
        matrices = np.concatenate([places @ inverse, np.eye(4)[None]])[:, :3]
        joint, weight, vertex = self._weights(_needed(skin.find("vertex_weights")), len(stored), len(names))
        self._moves += len(vertex)
        check_count(self._moves, MAX_MOVES, "vertices that joints move")
        total = np.bincount(vertex, weight, len(stored))
        blended = np.zeros((len(stored), 3, 4))
        for start in range(0, len(vertex), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            np.add.at(blended, vertex[part], weight[part, None, None] * matrices[joint[part]])
        still = total <= 0
        blended[still] = matrices[-1]
        blended /= np.where(still, 1.0, total)[:, None, None]
        moved = np.einsum("vij,vj->vi", blended[:, :, :3], stored) + blended[:, :, 3]
        mirrored = np.linalg.det(blended[:, :, :3]) * np.linalg.det(matrix[:3, :3]) < 0
        return Shape(mesh, moved, mirrored)

    def _joints(self, names: list[str], roots: list[Element]) -> Iterator[Element]:
        """Nodes by what their skeleton, or else the file, calls them."""
        known: dict[str, Element] = {}
        for root in [*roots, self._document.root]:
            for node in root.iter("node"):
                for key in ("sid", "id", "name"):
                    if key in node.attrib:
                        known.setdefault(node.attrib[key], node)
        for name in names:
            yield known[name.removeprefix("#")]

    def _weights(
        self, element: Element, vertices: int, joints: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each influence: int64 joint, float64 weight, int64 vertex."""
        offsets = {kind: (offset, uri) for kind, _, offset, uri in inputs(element)}
        width = 1 + max(offset for offset, _ in offsets.values())
        counts = numbers(element.find("vcount"), np.int64)
        table = numbers(element.find("v"), np.int64).reshape(-1, width)
        values = self._document.table(self._document.target(offsets["WEIGHT"][1]))[:, 0]
        joint, place = table[:, offsets["JOINT"][0]], table[:, offsets["WEIGHT"][0]]
        if len(counts) != vertices or (counts < 0).any() or counts.sum() != len(table):
            raise ValueError("joints and weights do not match the vertices")
        if len(table) and (joint.min() < -1 or joint.max() >= joints or place.min() < 0):
            raise ValueError("a joint or a weight does not exist")
        return np.where(joint < 0, joints, joint), values[place], np.repeat(np.arange(vertices), counts)


def _vertices(mesh: Element) -> Element:
    return _needed(mesh.find("vertices"))


def _needed(element: Element | None) -> Element:
    if element is None:
        raise ValueError("a part is missing")
    return element

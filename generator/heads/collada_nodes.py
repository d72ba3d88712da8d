# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of a Collada scene: where they are, and what they show."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from trimesh.transformations import rotation_matrix

from generator.heads.collada_file import Document, numbers
from generator.heads.limits import MAX_DEPTH, MAX_NODES, check_count

_SHOWN = ("instance_geometry", "instance_controller")


@dataclass(frozen=True)
class Instance:
    """A shape that a node shows. world: float64 [4, 4] of the node; column vectors."""

    element: Element
    world: np.ndarray


class Nodes:
    """Every node that the scene reaches. instances: what they show, in the file's order."""

    def __init__(self, document: Document) -> None:
        """Raises as :class:`Document` does."""
        self._document = document
        self.instances: list[Instance] = []
        self._world: dict[Element, np.ndarray] = {}
        self._count = 0
        for node in self._roots():
            self._walk(node, np.eye(4), 0)

    def world_of(self, node: Element) -> np.ndarray:
        """float64 [4, 4]; of a node that no scene shows, such as a skeleton of a library, as if it did."""
        if node not in self._world:
            self._walk(node, np.eye(4), 0, shown=False)
        return self._world[node]

    def _roots(self) -> list[Element]:
        root = self._document.root
        shown = root.find("scene/instance_visual_scene")
        scene = root.find("library_visual_scenes/visual_scene")
        if shown is not None:
            scene = self._document.target(shown.get("url"))
        if scene is not None:
            return scene.findall("node")
        whole = Element("node")
        for geometry in root.iterfind("library_geometries/geometry"):
            whole.append(Element("instance_geometry", {"url": f"#{geometry.get('id', '')}"}))
        return [whole]

    def _walk(self, node: Element, parent: np.ndarray, depth: int, *, shown: bool = True) -> None:
        self._count += 1
        check_count(self._count, MAX_NODES, "nodes")
        check_count(depth, MAX_DEPTH, "nodes within each other")
        world = parent @ _local(node)
        self._world.setdefault(node, world)
        for child in node:
            if child.tag == "node":
                self._walk(child, world, depth + 1, shown=shown)
            elif child.tag == "instance_node":
                self._walk(self._document.target(child.get("url")), world, depth + 1, shown=shown)
            elif child.tag in _SHOWN and shown:
                self.instances.append(Instance(child, world))


def _local(node: Element) -> np.ndarray:
    """float64 [4, 4]: a node's transforms, of which the last is done first."""
    matrix = np.eye(4)
    for step in node:
        if step.tag == "matrix":
            matrix = matrix @ numbers(step).reshape(4, 4)
        elif step.tag == "translate":
            x, y, z = numbers(step)
            matrix = matrix @ np.array([[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])
        elif step.tag == "rotate":
            x, y, z, degrees = numbers(step)
            if np.linalg.norm([x, y, z]) > 0:
                matrix = matrix @ rotation_matrix(np.radians(degrees), [x, y, z])
        elif step.tag == "scale":
            matrix = matrix @ np.diag([*numbers(step), 1.0])
        elif step.tag in ("skew", "lookat"):
            raise ValueError(f"a node with the transform {step.tag}")
    return matrix

# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a glTF scene as a viewer shows them: nodes, default morph weights, skins at their pose.

Not through trimesh, which takes skins and morph targets for nothing and sparse accessors for zeros.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from trimesh.transformations import quaternion_matrix

from generator.errors import HeadError
from generator.heads.gltf_accessors import Accessors
from generator.heads.limits import MAX_MOVES, MAX_NODES, MAX_TRIANGLES, MAX_VERTICES, check_count
from generator.heads.pieces import Piece
from generator.heads.triangles import of_fan, of_strip

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_AT_ONCE = 1 << 18


def read_pieces(header: dict[str, Any], accessors: Accessors) -> Iterator[Piece]:
    """What the default scene shows; lines and points are left out.

    Raises HeadError for more than a head may have; LookupError, TypeError or ValueError for what is
    malformed.
    """
    return _Scene(header, accessors).pieces()


class _Scene:
    def __init__(self, header: dict[str, Any], accessors: Accessors) -> None:
        self._header, self._accessors = header, accessors
        self._nodes: list[dict[str, Any]] = header.get("nodes", [])
        self._world = self._world_matrices()
        self._skins: dict[int, np.ndarray] = {}
        self._vertices = self._triangles = self._moves = 0

    def pieces(self) -> Iterator[Piece]:
        for index in self._shown():
            node = self._nodes[index]
            if "mesh" in node:
                mesh = self._header["meshes"][node["mesh"]]
                for primitive in mesh["primitives"]:
                    if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN):
                        weights = node.get("weights", mesh.get("weights", ()))
                        yield self._piece(primitive, weights, node.get("skin"), self._world[index])

    def _piece(self, primitive: dict[str, Any], weights: Any, skin: int | None, world: np.ndarray) -> Piece:
        attributes = primitive["attributes"]
        self._vertices += self._accessors.count(attributes["POSITION"])
        check_count(self._vertices, MAX_VERTICES, "vertices")
        stored = self._morphed(primitive, weights)
        triangles = self._corners(primitive, len(stored))
        self._triangles += len(triangles)
        check_count(self._triangles, MAX_TRIANGLES, "triangles")
        if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(stored)):
            raise HeadError(f"a face uses a vertex beyond {len(stored) - 1}; export the mesh again")
        if skin is not None and "JOINTS_0" in attributes:
            # glTF 2.0, 3.7.3.3: only the joints say where a skinned mesh is.
            vertices, mirrored = self._skinned(stored, attributes, skin)
            inside_out = mirrored[triangles].sum(1) > 1
        else:
            vertices = stored @ world[:3, :3].T + world[:3, 3]
            inside_out = np.full(len(triangles), np.linalg.det(world[:3, :3]) < 0)
        triangles = np.where(inside_out[:, None], triangles[:, ::-1], triangles)
        uv = None
        if "TEXCOORD_0" in attributes:
            uv = np.array(self._accessors.numbers(attributes["TEXCOORD_0"]))
            uv[:, 1] = 1.0 - uv[:, 1]
        color = self._accessors.values(attributes["COLOR_0"]) if "COLOR_0" in attributes else None
        if any(found is not None and len(found) != len(stored) for found in (uv, color)):
            raise ValueError("a primitive's attributes have different lengths")
        return Piece(vertices, triangles, uv, color, primitive.get("material"))

    def _corners(self, primitive: dict[str, Any], count: int) -> np.ndarray:
        if "indices" in primitive:
            check_count(self._accessors.count(primitive["indices"]), 3 * MAX_TRIANGLES, "corners")
            corners = self._accessors.values(primitive["indices"])[:, 0].astype(np.int64)
        else:
            corners = np.arange(count)
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return corners.reshape(-1, 3)
        if len(corners) < 3:
            return np.zeros((0, 3), np.int64)
        return of_strip(corners) if mode == _STRIP else of_fan(corners)

    def _morphed(self, primitive: dict[str, Any], weights: Any) -> np.ndarray:
        """float64 [V, 3], the mesh's own frame."""
        positions = self._accessors.numbers(primitive["attributes"]["POSITION"]).astype(np.float64)
        if positions.shape[1:] != (3,):
            raise ValueError("positions have no three coordinates")
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                self._count_moves(len(positions))
                positions += float(weight) * self._accessors.numbers(target["POSITION"])
        return positions

    def _skinned(
        self, stored: np.ndarray, attributes: dict[str, Any], skin: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Linear blend skinning at the pose that the joints' nodes have; and bool [V], where that mirrors."""
        joints: list[np.ndarray] = []
        weights: list[np.ndarray] = []
        while f"JOINTS_{len(joints)}" in attributes:
            self._count_moves(4 * len(stored))
            joints.append(self._accessors.values(attributes[f"JOINTS_{len(joints)}"]).astype(np.int64))
            weights.append(self._accessors.numbers(attributes[f"WEIGHTS_{len(weights)}"]))
        matrices, joint, weight = self._skin(skin), np.hstack(joints), np.hstack(weights).astype(np.float64)
        if joint.shape != weight.shape or len(joint) != len(stored):
            raise ValueError("joints and weights do not match the vertices")
        total = weight.sum(1, keepdims=True)
        first = np.arange(weight.shape[1]) == 0
        weight = np.where(total > 0, weight / np.where(total > 0, total, 1), first)
        moved, mirrored = np.empty_like(stored), np.empty(len(stored), dtype=bool)
        step = max(1, _AT_ONCE // weight.shape[1])
        for start in range(0, len(stored), step):
            part = slice(start, start + step)
            blended = np.einsum("vk,vkij->vij", weight[part], matrices[joint[part]])
            moved[part] = np.einsum("vij,vj->vi", blended[:, :, :3], stored[part]) + blended[:, :, 3]
            mirrored[part] = np.linalg.det(blended[:, :, :3]) < 0
        return moved, mirrored

    def _skin(self, index: int) -> np.ndarray:
        """float64 [joints, 3, 4]: from the mesh's frame at its bind pose to the scene's."""
        if index not in self._skins:
            skin = self._header["skins"][index]
            joints = skin["joints"]
            check_count(len(joints), MAX_NODES, "joints")
            world = np.stack([self._world[joint] for joint in joints])
            if "inverseBindMatrices" in skin:
                bind = self._accessors.numbers(skin["inverseBindMatrices"])[: len(joints)]
                world = world @ bind.astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
            self._skins[index] = world[:, :3]
        return self._skins[index]

    def _count_moves(self, count: int) -> None:
        self._moves += count
        check_count(self._moves, MAX_MOVES, "vertices that morph targets and joints move")

    def _world_matrices(self) -> dict[int, np.ndarray]:
        """float64 [4, 4] of every node, whether a scene shows it or not: joints may lie outside."""
        children = {child for node in self._nodes for child in node.get("children", ())}
        if not all(0 <= child < len(self._nodes) for child in children):
            raise ValueError("a node's child does not exist")
        world = {}
        waiting = [(index, np.eye(4)) for index in range(len(self._nodes)) if index not in children]
        while waiting:
            index, parent = waiting.pop()
            node = self._nodes[index]
            world[index] = parent @ _local(node)
            waiting += [(child, world[index]) for child in node.get("children", ())]
        return world

    def _shown(self) -> Iterator[int]:
        """The nodes of the default scene, each once, parents first; all of them where there is no scene."""
        if "scenes" in self._header:
            waiting = list(self._header["scenes"][self._header.get("scene", 0)].get("nodes", ()))[::-1]
        else:
            waiting = list(self._world)[::-1]
        seen: set[int] = set()
        while waiting:
            index = waiting.pop()
            if index not in seen:
                seen.add(index)
                yield index
                waiting += reversed(self._nodes[index].get("children", ()))


def _local(node: dict[str, Any]) -> np.ndarray:
    """float64 [4, 4] of a node in its parent's frame; column vectors."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    if "rotation" in node:
        x, y, z, w = (float(value) for value in node["rotation"])
        matrix = quaternion_matrix([w, x, y, z])
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64).reshape(3)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64).reshape(3)
    return matrix

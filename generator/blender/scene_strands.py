# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves of a scene as thin tubes, which hide what is behind them."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np

from generator.heads.mesh import HeadMesh, Material

SIDES = 4
DEFAULT_RADIUS = 0.005
"""Of strands that say none, in Cycles, in their own units."""

MAX_PIECES = 1 << 19
"""Between points of strands; of more, every second, third, ... strand hides something."""


def strands(owners: Collection[bpy.types.Object]) -> HeadMesh | None:
    """The hair curves of some objects in the world; None where there are none."""
    graph = bpy.context.evaluated_depsgraph_get()
    vertices, triangles, count = [], [], 0
    for instance in graph.object_instances:
        here = instance.object
        owner = (instance.parent if instance.is_instance else here).original
        if here.type != "CURVES" or owner not in owners or not instance.show_self or not here.visible_camera:
            continue
        if not len(here.data.points):
            continue
        tubes = _tubes(here.data, np.array(instance.matrix_world, dtype=np.float64))
        vertices.append(tubes[0])
        triangles.append(tubes[1] + count)
        count += len(tubes[0])
    if not sum(map(len, triangles)):
        return None
    every = np.concatenate(triangles).astype(np.int32)
    return HeadMesh(
        np.concatenate(vertices), every, None, None, np.zeros(len(every), np.int32), (Material("hair"),)
    )


def _tubes(data: bpy.types.Curves, world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices float64 [V, 3] in the world, and triangles int64 [T, 3]."""
    count = len(data.points)
    flat = np.empty(3 * count, dtype=np.float32)
    data.position_data.foreach_get("vector", flat)
    points = flat.reshape(-1, 3).astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    radius = np.full(count, DEFAULT_RADIUS, dtype=np.float32)
    if "radius" in data.attributes:
        data.attributes["radius"].data.foreach_get("value", radius)
    radii = radius * np.cbrt(abs(np.linalg.det(world[:3, :3])))
    offsets = np.empty(len(data.curves) + 1, dtype=np.int32)
    data.curve_offset_data.foreach_get("value", offsets)
    starts = np.setdiff1d(np.arange(count), offsets[1:] - 1)
    if len(starts) > MAX_PIECES:
        strand = np.searchsorted(offsets, starts, side="right")
        starts = starts[strand % -(-len(starts) // MAX_PIECES) == 0]
    along = points[starts + 1] - points[starts]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    starts, along = starts[length[:, 0] > 0], (along / np.where(length > 0, length, 1))[length[:, 0] > 0]
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = aside[:, None] * np.cos(turn)[:, None] + np.cross(along, aside)[:, None] * np.sin(turn)[:, None]
    rings = [points[k][:, None] + circle * radii[k][:, None, None] for k in (starts, starts + 1)]
    vertices = np.concatenate(rings, axis=1).reshape(-1, 3)
    side = np.arange(SIDES)
    following = (side + 1) % SIDES
    piece = np.concatenate(
        [
            np.stack([side, following, side + SIDES], axis=1),
            np.stack([following, following + SIDES, side + SIDES], axis=1),
        ]
    )
    places = 2 * SIDES * np.arange(len(starts))
    return vertices, (places[:, None, None] + piece).reshape(-1, 3)

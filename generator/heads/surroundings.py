# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a mesh belongs to the head whose face was found: not a floor, a backdrop, a stray triangle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement

NEAR = 1.5
"""Parts that lie within this many radii of the pivot, by most of their vertices, are the head's."""

MAIN_SHARE = 0.25
"""So is a part with this share of all vertices there: a bust, a body."""

TOUCH = 0.15
"""Parts within this many radii of the head's are worn: clothes, long hair."""

SHEET_SIDE, SHEET_DEPTH = 4.0, 0.02
"""A part wider than so many radii and thinner than this share of its width is a floor or a backdrop."""


def head_alone(mesh: HeadMesh, placement: Placement) -> HeadMesh:
    """A mesh as read without what does not belong to the head that was placed in it.

    Which that is follows from the recorded pivot and radius, so that a replay leaves out the same.
    The very mesh where all of it belongs, and that of a scene, where all else may hide landmarks.
    """
    if mesh.scene is not None:
        return mesh
    kept = head_triangles(mesh, placement)
    return mesh if kept.all() else with_triangles(mesh, kept)


def head_triangles(mesh: HeadMesh, placement: Placement) -> np.ndarray:
    """Which triangles of a mesh as read :func:`head_alone` keeps, bool [T]."""
    return surroundings(mesh, np.array(placement.pivot), placement.radius_mm / placement.mm_per_unit)


def surroundings(mesh: HeadMesh, pivot: np.ndarray, radius: float) -> np.ndarray:
    """Which triangles are the head's, bool [T]. pivot, radius: in the mesh's own units and axes."""
    count, labels = parts_of(mesh)
    if count == 1:
        return np.ones(len(mesh.triangles), dtype=bool)
    used = np.unique(mesh.triangles)
    of_used = labels[used]
    near = np.linalg.norm(mesh.vertices[used] - pivot, axis=1) <= NEAR * radius
    size = np.bincount(of_used, minlength=count)
    inside = np.bincount(of_used[near], minlength=count)
    kept = (inside > 0) & ((inside >= 0.5 * size) | (inside >= MAIN_SHARE * near.sum()))
    low, high = _boxes(mesh.vertices[used], of_used, count)
    for part in np.flatnonzero((size > 0) & (np.linalg.norm(high - low, axis=1) > SHEET_SIDE * radius)):
        if _is_flat(mesh.vertices[used[of_used == part]]):
            kept[part], size[part] = False, 0
    if not kept.any():
        return np.ones(len(mesh.triangles), dtype=bool)
    while (others := ~kept & (size > 0)).any():
        tree = cKDTree(mesh.vertices[used[kept[of_used]]])
        rest = others[of_used]
        distance, _ = tree.query(mesh.vertices[used[rest]], distance_upper_bound=TOUCH * radius)
        touching = np.unique(of_used[rest][np.isfinite(distance)])
        if not len(touching):
            break
        kept[touching] = True
    return kept[labels[mesh.triangles[:, 0]]]


def clusters(mesh: HeadMesh, most: int) -> list[HeadMesh]:
    """Parts that lie together, each group a mesh of its own; those with the most triangles first.

    Empty where all of the mesh is one group.
    """
    count, labels = parts_of(mesh)
    of_triangle = labels[mesh.triangles[:, 0]]
    triangles = np.bincount(of_triangle, minlength=count)
    used = np.unique(mesh.triangles)
    low, high = _boxes(mesh.vertices[used], labels[used], count)
    free = triangles > 0
    found: list[HeadMesh] = []
    while free.any() and len(found) < most:
        main = int(np.where(free, triangles, 0).argmax())
        room = 0.25 * np.linalg.norm(high[main] - low[main])
        overlaps = ((low <= high[main] + room) & (high >= low[main] - room)).all(axis=1)
        no_larger = (high - low).max(axis=1) <= 2.0 * (high[main] - low[main]).max()
        group = free & overlaps & no_larger
        if group[triangles > 0].all():
            return []
        free &= ~group
        found.append(with_triangles(mesh, group[of_triangle]))
    return found


def without_materials(mesh: HeadMesh, names: tuple[str, ...]) -> HeadMesh:
    """A mesh without the triangles of some materials. HeadError: there is no such material, or no other."""
    there = [material.name for material in mesh.materials]
    if unknown := [name for name in names if name not in there]:
        known = ", ".join(quoted(name) for name in dict.fromkeys(there))
        raise HeadError(f"no material {quoted(unknown[0])} to leave out; there are: {known}")
    dropped = [k for k, name in enumerate(there) if name in names]
    kept = ~np.isin(mesh.material_index, dropped)
    if not kept.any():
        raise HeadError("every triangle is of a material that is to be left out; name fewer with --without")
    return with_triangles(mesh, kept)


def with_triangles(mesh: HeadMesh, kept: np.ndarray) -> HeadMesh:
    """A mesh with some of its triangles and the vertices they use. kept: bool [T], not all False."""
    used, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        triangles=triangles.reshape(-1, 3).astype(mesh.triangles.dtype),
        uv=None if mesh.uv is None else mesh.uv[kept],
        vertex_colors=None if mesh.vertex_colors is None else mesh.vertex_colors[used],
        material_index=mesh.material_index[kept],
    )


def parts_of(mesh: HeadMesh) -> tuple[int, np.ndarray]:
    """Connected parts: how many, and of which each vertex is, int [V]. A vertex alone is one, too."""
    a, b, c = mesh.triangles.T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    shape = (len(mesh.vertices),) * 2
    graph = coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=shape)
    count, labels = connected_components(graph, directed=False)
    return int(count), labels


def _boxes(points: np.ndarray, labels: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the points of each label, float [count, 3]; of none: inf and -inf."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, labels, points)
    np.maximum.at(high, labels, points)
    return low, high


def _is_flat(points: np.ndarray) -> bool:
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points.T)), 0))
    return bool(spread[0] < SHEET_DEPTH * spread[2])

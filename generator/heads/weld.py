# SPDX-License-Identifier: GPL-3.0-or-later
"""Cleans a mesh as it was read: seams closed, what cannot be drawn removed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh

MAX_COORDINATE = 1e7
"""A head in micrometres measures 3e5; beyond this 32-bit renderers lose the shape."""

_AT_ONCE = 1 << 16


def weld(mesh: HeadMesh) -> HeadMesh:
    """The mesh with one vertex per position, in order of first appearance.

    Vertices that no triangle uses and triangles with two equal corners go.

    Raises
    ------
    HeadError: coordinates are absurdly large, or no triangle has an area.
    """
    vertices = mesh.vertices + 0.0  # turns -0.0 into 0.0
    used = np.unique(mesh.triangles)
    if np.abs(vertices[used]).max() > MAX_COORDINATE:
        raise HeadError(f"a coordinate is beyond {MAX_COORDINATE:.0e}; check the export")
    order = used[np.lexsort(vertices[used].T)]
    starts = np.concatenate([[True], (np.diff(vertices[order], axis=0) != 0).any(axis=1)])
    group = np.cumsum(starts) - 1
    # lexsort is stable, so the first of each run of equal positions has the lowest index.
    representative = np.empty(len(vertices), dtype=np.int64)
    representative[order] = order[starts][group]
    kept = np.unique(representative[used])
    new_index = np.full(len(vertices), -1, dtype=np.int32)
    new_index[kept] = np.arange(len(kept), dtype=np.int32)
    triangles = new_index[representative[mesh.triangles]]
    a, b, c = triangles.T
    real = (a != b) & (b != c) & (c != a)
    size = np.ptp(vertices[kept], axis=0).max()
    if not _has_area(vertices[kept], triangles[real], 1e-9 * size**2):
        raise HeadError("no triangle has an area; export the mesh again")
    return replace(
        mesh,
        vertices=vertices[kept],
        triangles=triangles[real],
        uv=None if mesh.uv is None else mesh.uv[real],
        vertex_colors=None if mesh.vertex_colors is None else mesh.vertex_colors[kept],
        material_index=mesh.material_index[real],
    )


def _has_area(vertices: np.ndarray, triangles: np.ndarray, least: float) -> bool:
    """Is twice the area of all triangles more than that? Millions of them are not looked at all at once."""
    total = 0.0
    for start in range(0, len(triangles), _AT_ONCE):
        p, q, r = np.moveaxis(vertices[triangles[start : start + _AT_ONCE]], 1, 0)
        total += float(np.linalg.norm(np.cross(q - p, r - p), axis=1).sum())
        if total > least:
            return True
    return False

# SPDX-License-Identifier: GPL-3.0-or-later
"""How open every vertex of a head is to light from everywhere: ambient occlusion, by casting rays.

The share of a hemisphere's light that reaches a point, weighted by the cosine (Zhukov et al., "An ambient
light illumination model", 1998). Directions are stratified and another set at every vertex, so that what
noise there is goes when neighbours are averaged; the same mesh gives the same numbers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.mesh import HeadMesh
from generator.heads.triangles import vertex_normals
from generator.landmarks.surface import Surface
from generator.plan.views import Views

RAYS = 1 << 20
"""Of a head, about: a fifth of a second."""

MOST, LEAST = 64, 6
"""Rays of a vertex."""

AVERAGED = 160
"""Rays that a vertex and its neighbours have together, once they are averaged."""

SHEET = 0.25
"""Less open than that is where nobody looks, or the inner side of a sheet."""

LIFT_MM = 0.2
"""How far above the surface rays start: a face is wider than a thousand of these."""

BATCH = 1 << 14
"""Vertices at a time; bounds the memory."""

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def shades(views: Views) -> bool:
    """Does any view ask how open the head's vertices are?"""
    return any(look.occlusion > 0 for look in views.looks)


def with_occlusion(mesh: HeadMesh, surface: Surface | None = None) -> HeadMesh:
    """The mesh with the openness of its vertices.

    surface: what shades it, by default itself; cut-out materials let light through.
    mesh: frame U, mm. Raises HeadError if the texture of a cut-out material cannot be read.
    """
    return replace(mesh, openness=openness(mesh, surface or Surface(mesh)))


def openness(mesh: HeadMesh, surface: Surface) -> np.ndarray:
    """1 in the open, 0 where no light comes, float32 [V]. Parameters as in :func:`with_occlusion`."""
    count = len(mesh.vertices)
    rays = int(np.clip(RAYS // count, LEAST, MOST))
    points = mesh.vertices @ CAMERA_FROM_GRAPHICS
    normals, _ = vertex_normals(points, mesh.triangles)
    found = np.empty(count)
    for start in range(0, count, BATCH):
        some = np.arange(start, min(start + BATCH, count))
        found[some] = _open_share(surface, points[some], normals[some], rays, some)
        # A sheet, such as hair that hangs, has two sides and one value: the one that is more open.
        some = some[found[some] < SHEET]
        behind = _open_share(surface, points[some], -normals[some], rays, some)
        found[some] = np.maximum(found[some], behind)
    average = _averaging(mesh)
    for _ in range(max(1, round(np.log2(AVERAGED / rays)))):
        found = average @ found
    return found.astype(np.float32)


def _open_share(
    surface: Surface, points: np.ndarray, normals: np.ndarray, rays: int, numbers: np.ndarray
) -> np.ndarray:
    """Share of rays from points [N, 3] about normals [N, 3] that meet nothing. numbers: of the points."""
    # Even on the unit disc, and lifted onto the hemisphere: weighted by the cosine (Malley's method).
    turn = (numbers * 0.6180339887 % 1 * 2 * np.pi)[:, None]
    ray = np.arange(rays)
    radius = np.sqrt((ray + 0.5) / rays)
    angle = ray * _GOLDEN_ANGLE + turn
    across, along = _tangents(normals)
    directions = (
        (radius * np.cos(angle))[..., None] * across[:, None]
        + (radius * np.sin(angle))[..., None] * along[:, None]
        + np.sqrt(1 - radius**2)[:, None] * normals[:, None]
    )
    origins = np.repeat(points + LIFT_MM * normals, rays, axis=0)
    blocked = surface.blocked(origins, directions.reshape(-1, 3))
    return 1 - blocked.reshape(-1, rays).mean(axis=1)


def _tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors a normal that stand on it and on each other (Duff et al., JCGT 6(1), 2017)."""
    x, y, z = normals.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1 / (sign + z)
    b = x * y * a
    return (
        np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


def _averaging(mesh: HeadMesh) -> csr_matrix:
    """[V, V]: the mean of a vertex, twice, and of those that share an edge with it."""
    count = len(mesh.vertices)
    a = mesh.triangles.ravel()
    b = np.roll(mesh.triangles, 1, axis=1).ravel()
    edges = np.unique(np.sort(np.stack([a, b]), axis=0), axis=1)
    rows, columns = np.concatenate([edges, edges[::-1], np.tile(np.arange(count), (4, 1)).reshape(2, -1)], 1)
    matrix = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
    total = np.asarray(matrix.sum(axis=1)).ravel()
    return csr_matrix(matrix.multiply(1 / total[:, None]))

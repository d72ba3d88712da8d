# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine part of a quad mesh once, as a linear map of its vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, vstack


@dataclass(frozen=True)
class Refined:
    """A refined mesh. refine: sparse [new, old]; triangles, triangle_uv int [T, 3];
    uv [U, K]; face: int [T], the quad of the old mesh each triangle comes from.
    """

    refine: csr_matrix
    triangles: np.ndarray
    triangle_uv: np.ndarray
    uv: np.ndarray
    face: np.ndarray


def refine_quads(
    quads: np.ndarray, quad_uv: np.ndarray, uv: np.ndarray, count: int, chosen: np.ndarray
) -> Refined:
    """One Catmull-Clark step (Catmull and Clark 1978) on the chosen quads; triangles of the whole.

    The border of the patch stays where it is, and the quads around it take up its
    midpoints, so neither a crack nor a shading seam opens.

    Parameters
    ----------
    quads, quad_uv: int [F, 4]; uv float [U, K]; count: number of vertices.
    chosen: bool [F].
    """
    patch = quads[chosen]
    faces = np.arange(len(patch))
    edges, edge_of = np.unique(_edges(patch), axis=0, return_inverse=True)
    edge_of = edge_of.reshape(-1, 4)
    uses = np.bincount(edge_of.ravel(), minlength=len(edges))

    ends = _incidence(np.repeat(np.arange(len(edges)), 2), edges.ravel(), (len(edges), count)) * 0.5
    face_points = _incidence(np.repeat(faces, 4), patch.ravel(), (len(patch), count)) * 0.25
    edge_faces = _incidence(edge_of.ravel(), np.repeat(faces, 4), (len(edges), len(patch)))
    inner = (uses == 2).astype(float)
    edge_points = diags(1 - inner / 2) @ ends + diags(inner / 4) @ edge_faces @ face_points

    inside = np.zeros(count)
    inside[patch.ravel()] = 1
    inside[edges[uses == 1].ravel()] = 0
    valence = np.maximum(np.bincount(edges.ravel(), minlength=count), 1)
    at_face = _incidence(patch.ravel(), np.repeat(faces, 4), (count, len(patch)))
    at_edge = _incidence(edges.ravel(), np.repeat(np.arange(len(edges)), 2), (count, len(edges)))
    around = at_face @ face_points + 2 * at_edge @ ends
    smooth = diags(1 / valence**2) @ around + diags((valence - 3) / valence)
    old = diags(1 - inside) @ identity(count) + diags(inside) @ smooth

    fine = _split(patch, count + edge_of, count + len(edges) + faces)
    # Texture coordinates take straight midpoints, so the paint does not slide.
    patch_uv = quad_uv[chosen]
    uv_edges, uv_edge_of = np.unique(_edges(patch_uv), axis=0, return_inverse=True)
    fine_uv = _split(patch_uv, len(uv) + uv_edge_of.reshape(-1, 4), len(uv) + len(uv_edges) + faces)
    uv = np.concatenate([uv, uv[uv_edges].mean(1), uv[patch_uv].mean(1)])

    midpoint = {(int(a), int(b)): count + k for k, (a, b) in enumerate(edges)}
    rest = np.flatnonzero(~chosen)
    triangles = [_triangulate(fine)]
    corners = [_triangulate(fine_uv)]
    face = [np.repeat(np.flatnonzero(chosen), 8)]
    sides = _edges(quads[rest])
    touched = np.isin(sides @ (count, 1), edges @ (count, 1)).reshape(-1, 4).any(1)
    plain = rest[~touched]
    triangles.append(_triangulate(quads[plain]))
    corners.append(_triangulate(quad_uv[plain]))
    face.append(np.repeat(plain, 2))
    added = list(uv)
    for f in rest[touched]:
        loop, loop_uv, start = [], [], 0
        for i in range(4):
            a, b = int(quads[f, i]), int(quads[f, (i + 1) % 4])
            loop.append(a)
            loop_uv.append(int(quad_uv[f, i]))
            middle = midpoint.get((min(a, b), max(a, b)))
            if middle is not None:
                start = len(loop)
                loop.append(middle)
                loop_uv.append(len(added))
                added.append((uv[quad_uv[f, i]] + uv[quad_uv[f, (i + 1) % 4]]) / 2)
        # A fan from a midpoint has no triangle with three corners on one edge.
        loop, loop_uv = loop[start:] + loop[:start], loop_uv[start:] + loop_uv[:start]
        fan = [(0, k, k + 1) for k in range(1, len(loop) - 1)]
        triangles.append(np.array(loop)[fan])
        corners.append(np.array(loop_uv)[fan])
        face.append(np.full(len(fan), f))
    return Refined(
        refine=csr_matrix(vstack([old, edge_points, face_points])),
        triangles=np.concatenate(triangles),
        triangle_uv=np.concatenate(corners),
        uv=np.array(added),
        face=np.concatenate(face),
    )


def _edges(quads: np.ndarray) -> np.ndarray:
    """Sorted edges [4 F, 2], edge i of a quad from corner i to i + 1."""
    return np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)


def _incidence(rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> csr_matrix:
    return csr_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)


def _split(corner: np.ndarray, edge: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Four quads a quad: corner, edge after it, centre, edge before it."""
    quads = [np.stack([corner[:, i], edge[:, i], face, edge[:, i - 1]], axis=1) for i in range(4)]
    return np.stack(quads, axis=1).reshape(-1, 4)


def _triangulate(quads: np.ndarray) -> np.ndarray:
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)

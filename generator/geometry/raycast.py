# SPDX-License-Identifier: GPL-3.0-or-later
"""First hits of a few rays on a triangle mesh."""

from __future__ import annotations

import numpy as np


def first_hits(
    origins: np.ndarray, directions: np.ndarray, vertices: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Where rays first meet a mesh, from either side of a triangle.

    Möller and Trumbore, "Fast, minimum storage ray/triangle intersection",
    J. Graphics Tools 2(1), 1997, one ray against all triangles at a time: right
    for a handful of rays, not for an image.

    Parameters
    ----------
    origins, directions: float [N, 3]. vertices: float [V, 3]. triangles: int [T, 3].

    Returns
    -------
    float64 [N, 3] hit points, NaN where a ray meets nothing.
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    hits = np.full((len(origins), 3), np.nan)
    for row, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(direction, ac)
        determinant = (ab * p).sum(1)
        flat = determinant == 0
        inverse = 1.0 / np.where(flat, 1.0, determinant)
        s = origin - a
        u = (s * p).sum(1) * inverse
        q = np.cross(s, ab)
        v = (direction * q).sum(1) * inverse
        t = (ac * q).sum(1) * inverse
        inside = ~flat & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if inside.any():
            hits[row] = origin + t[inside].min() * direction
    return hits

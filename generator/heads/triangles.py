# SPDX-License-Identifier: GPL-3.0-or-later
"""Strips and fans as triangles, and the normals of triangles' vertices."""

from __future__ import annotations

import numpy as np


def of_strip(corners: np.ndarray) -> np.ndarray:
    """int [N] -> int [N - 2, 3]: each corner with the two before it, every second triangle turned about."""
    triangles = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    triangles[1::2] = triangles[1::2, [1, 0, 2]]
    return triangles


def of_fan(corners: np.ndarray) -> np.ndarray:
    """int [N] -> int [N - 2, 3]: all of them begin at the first corner."""
    return np.stack([np.broadcast_to(corners[:1], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)


def of_strips(corners: np.ndarray) -> np.ndarray:
    """int [N] -> int [T, 3]: strips one after the other, each but the last ended by a negative number."""
    if len(corners) < 3:
        return np.zeros((0, 3), corners.dtype)
    place = np.arange(len(corners))
    begin = np.maximum.accumulate(np.where(corners < 0, place + 1, 0))
    triangles = of_strip(corners)
    # of_strip turned about every second triangle of the whole; it should be every second of its strip.
    wrong = begin[:-2] % 2 == 1
    triangles[wrong] = triangles[wrong][:, [1, 0, 2]]
    return triangles[(triangles >= 0).all(axis=1)]


def of_polygons(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fans: int64 [T, 3] into the corners of polygons that follow each other, and int64 [T] which polygon.

    counts: int64 [P], how many corners each has, 3 or more.
    """
    triangles = counts - 2
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    corners = np.stack([first, first + step + 1, first + step + 2], axis=1)
    return corners, np.repeat(np.arange(len(counts)), triangles)


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Area-weighted unit normals [V, 3] and a third of the surrounding area [V]; zero where unused."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a) / 2
    corner = triangles.ravel()
    per_corner = np.repeat(cross, 3, axis=0)
    count = len(vertices)
    sums = np.stack([np.bincount(corner, per_corner[:, k], minlength=count) for k in range(3)], axis=1)
    areas = np.bincount(corner, np.linalg.norm(per_corner, axis=1), minlength=count) / 3
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.divide(sums, length, out=np.zeros_like(sums), where=length > 0), areas

# SPDX-License-Identifier: GPL-3.0-or-later
"""Open boundaries of a mesh, and which of them are the eyes and the mouth."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

EYE_WIDTH_MM = (15.0, 45.0)
EYE_HEIGHT_MM = 25.0
EYES_APART_MM = (45.0, 90.0)
MOUTH_WIDTH_MM = (25.0, 100.0)


@dataclass(frozen=True)
class FaceHoles:
    """Vertex loops, each ordered against the triangles beside it, so that filling it faces outwards.

    left: the eye on the subject's left (+X). mouth: None without an opening.
    """

    left: np.ndarray
    right: np.ndarray
    mouth: np.ndarray | None


def boundary_loops(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed loops of edges that only one triangle uses. int [T, 3] -> list of int64 [n]."""
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    count = int(triangles.max()) + 1
    ahead, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    following: dict[int, list[int]] = {}
    for start, end in edges[~np.isin(ahead, back)]:
        following.setdefault(int(end), []).append(int(start))
    loops = []
    while following:
        first = min(following)
        loop = [first]
        while (candidates := following.get(loop[-1])) is not None:
            step = candidates.pop()
            if not candidates:
                del following[loop[-1]]
            if step == first:
                loops.append(np.array(loop))
                break
            loop.append(step)
    return loops


def find_face_holes(vertices: np.ndarray, triangles: np.ndarray) -> FaceHoles | None:
    """The eye holes and the mouth of a head in frame U, millimetres, roughly upright.

    The eyes are the pair of holes of an eye's size that mirror each other best
    about the middle of the face, on the front of the head; the mouth lies
    below, between them. None without such a pair.
    """
    front = (vertices[:, 2].min() + vertices[:, 2].max()) / 2
    loops = [(loop, vertices[loop]) for loop in boundary_loops(triangles) if len(loop) >= 6]
    loops = [(loop, points) for loop, points in loops if points[:, 2].mean() > front]
    boxes = [(loop, (points.min(0) + points.max(0)) / 2, np.ptp(points, axis=0)) for loop, points in loops]
    low, high = EYE_WIDTH_MM
    eyes = [box for box in boxes if low <= box[2][0] <= high and box[2][1] <= EYE_HEIGHT_MM]
    middle = (vertices[:, 0].min() + vertices[:, 0].max()) / 2
    best, best_cost = None, 30.0
    for one, other in combinations(eyes, 2):
        (_, a, size_a), (_, b, size_b) = one, other
        if not EYES_APART_MM[0] <= abs(a[0] - b[0]) <= EYES_APART_MM[1]:
            continue
        asymmetry = np.abs(a + b - 2 * middle)[0] + np.abs(a - b)[1:].sum() + np.abs(size_a - size_b).sum()
        if asymmetry < best_cost:
            best, best_cost = ((one, other) if a[0] > b[0] else (other, one)), asymmetry
    if best is None:
        return None
    (left, a, _), (right, b, _) = best
    between = (a + b) / 2
    mouth, widest = None, MOUTH_WIDTH_MM[0]
    for loop, centre, size in boxes:
        width = size[0]
        below = 25.0 < between[1] - centre[1] < 120.0 and abs(centre[0] - between[0]) < 20.0
        if below and widest <= width <= MOUTH_WIDTH_MM[1]:
            mouth, widest = loop, width
    return FaceHoles(left, right, mouth)

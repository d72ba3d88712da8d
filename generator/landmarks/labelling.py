# SPDX-License-Identifier: GPL-3.0-or-later
"""What the triangles of any head are: by the names of its materials, and by its landmarks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import BROWS, EYES, LIPS, SKIN, TEETH, named

# Contours of MediaPipe Face Mesh, in order.
_LIPS = (61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 409, 270, 269, 267, 0, 37, 39, 40, 185)
_MOUTH = (78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 415, 310, 311, 312, 13, 82, 81, 80, 191)
_EYES = (
    (33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246),
    (263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466),
)
_BROWS = ((46, 53, 52, 65, 55, 107, 66, 105, 63, 70), (276, 283, 282, 295, 285, 336, 296, 334, 293, 300))

_AREAS = (
    *((BROWS, contour) for contour in _BROWS),
    *((EYES, contour) for contour in _EYES),
    (LIPS, _LIPS),
    (TEETH, _MOUTH),
)
"""Each lies over those before it."""

OPEN_MM = 3.0
"""Lips that are nearer to each other, at landmarks 13 and 14, are closed: the detector parts all a little."""

DEEP_MM, BEFORE_MM = 20.0, 8.0
"""How far behind and before its contour the surface of an area may lie."""


def name_label(material: Material) -> str:
    """What a material is by its name; skin, where that does not say."""
    return named(material.name)


def labelled(mesh: HeadMesh, points: np.ndarray) -> HeadMesh:
    """A mesh whose materials say what they are, with one more for each area of the face.

    mesh: frame U, mm. points: float [468, 3], Face Mesh on it, frame U, mm; of areas with points that are
    NaN nothing is told. Triangles, vertices and pictures stay as they are.
    """
    materials = [replace(material, label=name_label(material)) for material in mesh.materials]
    index = mesh.material_index.copy()
    middles = mesh.vertices[mesh.triangles].mean(axis=1)
    skin = np.array([material.label == SKIN for material in materials])[index]
    for label, contour in _AREAS:
        outline = points[list(contour)]
        if not np.isfinite(outline).all():
            continue
        if label == TEETH and np.linalg.norm(points[13] - points[14]) < OPEN_MM:
            continue
        low, high = outline[:, 2].min() - DEEP_MM, outline[:, 2].max() + BEFORE_MM
        near = np.flatnonzero(skin & (middles[:, 2] > low) & (middles[:, 2] < high))
        inside = near[_inside(middles[near, :2], outline[:, :2])]
        for number in np.unique(mesh.material_index[inside]):
            index[inside[mesh.material_index[inside] == number]] = len(materials)
            materials.append(replace(materials[number], label=label))
    return replace(mesh, material_index=index.astype(mesh.material_index.dtype), materials=tuple(materials))


def _inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Which points lie in a polygon, bool [N]: by the edges to their right. float [N, 2], [K, 2]."""
    x, y = points[:, :1], points[:, 1:]
    (x1, y1), (x2, y2) = polygon.T, np.roll(polygon, -1, axis=0).T
    crosses = (y1 > y) != (y2 > y)
    where = x1 + (y - y1) * (x2 - x1) / np.where(y2 == y1, 1, y2 - y1)
    odd: np.ndarray = (crosses & (x < where)).sum(axis=1) % 2 == 1
    return odd

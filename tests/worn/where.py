# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions that the tests of worn things ask."""

from __future__ import annotations

import numpy as np

from generator.heads.mesh import HeadMesh
from generator.worn.face import Face
from generator.worn.fit import Fit

SOURCES = ("parametric", "facescape", "ict")
"""Of the heads that things are fitted to."""


def of_material(mesh: HeadMesh, *names: str) -> np.ndarray:
    """Vertices of the materials whose names begin so, float64 [N, 3]."""
    numbers = [k for k, material in enumerate(mesh.materials) if material.name.startswith(names)]
    return mesh.vertices[np.unique(mesh.triangles[np.isin(mesh.material_index, numbers)])]


def behind_front_mm(fit: Fit, vertices: np.ndarray) -> float:
    """How deep the deepest vertex lies under the surface that the front shows. 0: none does."""
    face = Face.of(fit)
    points = vertices @ face.rotation
    depth = face.front(points[:, 0], points[:, 1]) - points[:, 2]
    return max(0.0, float(np.nanmax(depth, initial=0.0)))


def covers(thing: HeadMesh, fit: Fit, places: np.ndarray) -> np.ndarray:
    """Which points of the head [N, 3] have the thing between them and one who looks from outside, from where
    the surface faces to, bool [N]; along lines from the head's middle."""
    middle = np.array([0.0, 0.0, 20.0])
    out = places - middle
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    alone = Fit(thing, fit.points)
    reach = alone.outermost(middle, out)
    return reach > ((places - middle) * out).sum(axis=1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's surface for rays: what a camera sees first, holes of cut-out materials included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from trimesh.triangles import closest_point, points_to_barycentric

from generator.errors import HeadError
from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.heads.textures import alpha_channel
from generator.heads.tiling import texels
from generator.plan.views import Views

HOLES = 8
"""Transparent layers a ray goes through, as many as the renderer's."""

STEP_MM = 1e-3
"""How far behind a hole the search goes on."""

TOLERANCE_MM = 0.1
"""A point nearer than this behind the first hit is on the surface."""


TOGETHER = 64
"""Views whose rays are cast at once."""


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of N rays.

    triangles: int32 [N], -1 where nothing is hit. weights: float64 [N, 3], barycentric.
    points: float64 [N, 3]. distances: float64 [N] in lengths of the ray's direction, inf
    where nothing is hit (points and weights are NaN there).
    """

    triangles: np.ndarray
    weights: np.ndarray
    points: np.ndarray
    distances: np.ndarray


class Surface:
    """The triangles of a head in frame C at pose zero, mm, pivot at the origin.

    Rays are cast by Embree (Wald et al., "Embree: a kernel framework for efficient CPU
    ray tracing", ACM TOG 33(4), 2014) in float32; hits are computed again in float64.

    mesh: frame U, mm, pivot at the origin. Raises HeadError if the texture of a cut-out
    material cannot be read.
    """

    def __init__(self, mesh: HeadMesh) -> None:
        self.vertices = mesh.vertices @ CAMERA_FROM_GRAPHICS
        self.triangles = mesh.triangles
        self._scene = EmbreeScene(robust=True)
        # Kept: Embree reads the vertices in place.
        self._geometry = TriangleMesh(
            self._scene, self.vertices.astype(np.float32), self.triangles.astype(np.int32)
        )
        self._uv = mesh.uv
        self._material_index = mesh.material_index
        self._wrap = [m.wrap for m in mesh.materials]
        self._alpha = [
            _alpha(m.texture) if m.cutout and m.texture is not None and mesh.uv is not None else None
            for m in mesh.materials
        ]
        cutout = np.array([alpha is not None for alpha in self._alpha])
        self._may_be_hole = cutout[mesh.material_index]

    def first_hits(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """Where rays first meet the surface, from either side. float [N, 3] twice."""
        start = np.array(origins, dtype=np.float64)
        directions = np.asarray(directions, dtype=np.float64)
        triangles = np.full(len(start), -1, dtype=np.int32)
        weights = np.full((len(start), 3), np.nan)
        todo = np.arange(len(start))
        for _ in range(HOLES):
            found = self._scene.run(
                start[todo].astype(np.float32), directions[todo].astype(np.float32), output=True
            )["primID"]
            triangles[todo] = found
            todo = todo[found >= 0]
            weights[todo] = self._weights(triangles[todo], start[todo], directions[todo])
            holes = self._are_holes(triangles[todo], weights[todo])
            todo = todo[holes]
            if not len(todo):
                break
            behind = STEP_MM / np.linalg.norm(directions[todo], axis=1, keepdims=True)
            start[todo] = self.points(triangles[todo], weights[todo]) + behind * directions[todo]
            triangles[todo] = -1
        weights[triangles < 0] = np.nan
        points = self.points(triangles, weights)
        squared = (directions**2).sum(1)
        distances = ((points - origins) * directions).sum(1) / squared
        return Hits(triangles, weights, points, np.where(triangles < 0, np.inf, distances))

    def blocked(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Which rays meet the surface, bool [N]; what is cut out lets them through. float [N, 3] twice."""
        found = self._scene.run(origins.astype(np.float32), directions.astype(np.float32))
        return (found >= 0) & ~self._may_be_hole[found]

    def points(self, triangles: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Points of (triangle, barycentric weights). int [N], float [N, 3] -> float64 [N, 3]."""
        corners = self.vertices[self.triangles[triangles]]
        return (weights[:, :, None] * corners).sum(1)

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest surface points of some points, as (triangles int32 [N], weights float64 [N, 3])."""
        corners = self.vertices[self.triangles]
        low, high = corners.min(1), corners.max(1)
        triangles = np.empty(len(points), dtype=np.int32)
        weights = np.empty((len(points), 3))
        for row, point in enumerate(points):
            # No triangle is nearer than its box, none farther than its first corner.
            box = np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0), axis=1)
            near = np.flatnonzero(box <= np.linalg.norm(corners[:, 0] - point, axis=1).min())
            candidates = _closest_weights(corners[near], point)
            distance = np.linalg.norm((candidates[:, :, None] * corners[near]).sum(1) - point, axis=1)
            best = int(distance.argmin())
            triangles[row], weights[row] = near[best], candidates[best]
        return triangles, weights

    def off(self, points: np.ndarray) -> int:
        """How many points are farther than TOLERANCE_MM from the surface. float [P, 3]; NaN does not count.

        A triangle through a point faces one of the three axes within 55 degrees, so a short ray along
        that axis meets it; only where none does, such as on an open edge, the nearest point is looked for.
        """
        todo = points[np.isfinite(points).all(axis=1)]
        for axis in np.eye(3):
            start, along = todo - TOLERANCE_MM * axis, np.broadcast_to(axis, todo.shape)
            found = self._scene.run(start.astype(np.float32), along.astype(np.float32), output=True)
            todo = todo[(found["primID"] < 0) | (found["tfar"] > 2 * TOLERANCE_MM)]
        triangles, weights = self.nearest(todo)
        near = np.linalg.norm(self.points(triangles, weights) - todo, axis=1) <= TOLERANCE_MM
        return int((~near).sum())

    def visible(self, points: np.ndarray, views: Views) -> np.ndarray:
        """Which points of the surface the camera of each view sees.

        Parameters
        ----------
        points: float [P, 3], frame C at pose zero, mm; NaN is never visible.

        Returns
        -------
        bool [N, P]: inside the image, with nothing in front.
        """
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        seen = np.zeros((len(views), len(points)), dtype=bool)
        rotations = rotation_from_angles(views.angles_deg)
        for start in range(0, len(views), TOGETHER):
            few = slice(start, start + TOGETHER)
            cameras = [view.camera for view in views[few]]
            hidden = self.hides(points[known], rotations[few], cameras)
            for row, (camera, rotation) in enumerate(zip(cameras, rotations[few], strict=True), start):
                pixels = camera.project(points[known] @ rotation.T + camera.translation_mm)
                seen[row, known] = camera.holds(pixels) & ~hidden[row - start]
        return seen

    def hides(
        self,
        points: np.ndarray,
        rotations: np.ndarray,
        cameras: Sequence[Camera],
        *,
        offsets: np.ndarray | None = None,
        nearer_mm: float = TOLERANCE_MM,
        from_mm: float = 0.0,
    ) -> np.ndarray:
        """Which points the surface keeps from the cameras of N views, bool [N, P].

        points: float [P, 3], finite, frame C at pose zero, mm. rotations: R_C [N, 3, 3], of both.
        offsets: of the surface, float [N, 3], frame C at pose zero, mm. nearer_mm: by how much it has to be
        before them. from_mm: what is nearer to the cameras hides nothing.
        """
        starts, rays, far = [], [], []
        for row, (rotation, camera) in enumerate(zip(rotations, cameras, strict=True)):
            posed = points @ rotation.T + camera.translation_mm
            origins, directions = camera.towards(posed)
            origins = origins + from_mm * directions
            # The mesh stays where it is and the rays turn: (o - t) R is R^T (o - t).
            start = (origins - camera.translation_mm) @ rotation
            starts.append(start if offsets is None else start - offsets[row])
            rays.append(directions @ rotation)
            far.append(posed[:, 2] - from_mm - nearer_mm / np.linalg.norm(directions, axis=1))
        if not starts:
            return np.zeros((0, len(points)), dtype=bool)
        hits = self.first_hits(np.concatenate(starts), np.concatenate(rays))
        hidden: np.ndarray = hits.distances.reshape(len(starts), -1) < np.stack(far)
        return hidden

    def _weights(self, triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Barycentric weights of rays in the planes of triangles they are known to hit."""
        a, b, c = np.moveaxis(self.vertices[self.triangles[triangles]], 1, 0)
        ab, ac = b - a, c - a
        p = np.cross(directions, ac)
        determinant = (ab * p).sum(1)
        inverse = 1.0 / np.where(determinant == 0, 1.0, determinant)
        s = origins - a
        u = (s * p).sum(1) * inverse
        v = (directions * np.cross(s, ab)).sum(1) * inverse
        # Rounding may put a hit a hair's breadth beside the triangle's edge.
        weights = np.clip(np.stack([1 - u - v, u, v], axis=1), 0, 1)
        return weights / weights.sum(1, keepdims=True)

    def _are_holes(self, triangles: np.ndarray, weights: np.ndarray) -> np.ndarray:
        holes = np.zeros(len(triangles), dtype=bool)
        if self._uv is None:
            return holes
        for row in np.flatnonzero(self._may_be_hole[triangles]):
            triangle = triangles[row]
            material = self._material_index[triangle]
            alpha = self._alpha[material]
            assert alpha is not None, "only triangles of cut-out materials may be holes"
            uv = weights[row] @ self._uv[triangle].astype(np.float64)
            holes[row] = alpha[texels(uv, self._wrap[material], alpha.shape)] < 128
        return holes


def _closest_weights(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Barycentric weights of the point of each triangle that is closest to point.

    corners: float [M, 3, 3] -> float64 [M, 3].
    """
    on_triangle = closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
    flat = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) == 0
    weights = np.zeros((len(corners), 3))
    weights[flat, 0] = 1.0
    weights[~flat] = points_to_barycentric(corners[~flat], on_triangle[~flat], method="cross")
    weights = np.clip(weights, 0, 1)
    return weights / weights.sum(1, keepdims=True)


def _alpha(texture: Path) -> np.ndarray:
    alpha = alpha_channel(texture)
    if alpha is None:
        raise HeadError(f"{texture}: the alpha channel of a cut-out material cannot be read; save it as PNG")
    return alpha

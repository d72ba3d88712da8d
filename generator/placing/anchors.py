# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors from a few near-frontal views.

What a detector finds on one image is off by a pixel or two, and differently so on the next.
The landmarks of several slightly turned views are cast onto the surface and averaged there;
from then on they are exact at any pose, and the detector is no longer needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.landmarks.anchors import Anchors
from generator.landmarks.topology import Topology

if TYPE_CHECKING:
    from generator.landmarks.surface import Surface

MAX_OFF_MM = 15.0
"""A landmark farther beside the silhouette than this has no place on the mesh."""

MAX_ASTRAY_MM = 30.0
"""A landmark farther from its place in the mean face is not on the face. Faces are within 20 mm."""

MAX_SLIDE_MM = 2.0
"""The mean of the hits is put on the surface along the camera's axis if that moves it no
farther than this, and otherwise to the nearest point."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """One detection. rotation: R_C [3, 3]. landmarks: float [P, 3], as a detector gives them."""

    rotation: np.ndarray
    landmarks: np.ndarray

    @property
    def pixels(self) -> np.ndarray:
        """float [P, 2]."""
        return self.landmarks[:, :2]


def _rounded(weights: np.ndarray, decimals: int) -> np.ndarray:
    """Barycentric weights [N, 3] with so many decimals, the largest such that they still add up to 1."""
    rounded = np.round(weights, decimals)
    largest = np.argmax(rounded, axis=1)[:, None]
    rest = np.take_along_axis(rounded, largest, axis=1) + 1.0 - rounded.sum(axis=1, keepdims=True)
    np.put_along_axis(rounded, largest, rest, axis=1)
    return rounded


def find_anchors(surface: Surface, views: Sequence[Sighting], camera: Camera, topology: Topology) -> Anchors:
    """Cast every view's landmarks onto the surface and average them there.

    views: at least one, of the surface seen by camera. Points whose rays miss the surface use
    the vertex nearest to the ray, up to 15 mm away; see :class:`Anchors` for what is counted.
    """
    hits, missed = zip(*(_cast(surface, view, camera) for view in views), strict=True)
    found, beside = np.stack(hits), np.stack(missed)
    centre, astray = _brought_back(robust_mean(found), topology)
    mean = anchors_at(surface, centre, topology)
    points, absent = mean.points, mean.triangles < 0
    distances = np.linalg.norm(np.where(beside[..., None], np.nan, found) - points, axis=2)
    seen = [camera.project(points @ view.rotation.T + camera.translation_mm) for view in views]
    pixels = [np.linalg.norm(p - view.pixels, axis=1) for p, view in zip(seen, views, strict=True)]
    return replace(
        mean,
        views=len(views),
        off=int((astray | (beside.mean(axis=0) > 0.5))[~absent].sum()),
        residual_px=_rms(np.stack(pixels)),
        residual_mm=float(np.nanmedian(distances)) if np.isfinite(distances).any() else float("nan"),
    )


def anchors_at(surface: Surface, points: np.ndarray, topology: Topology) -> Anchors:
    """The points of a surface that stand for points near it, float [P, 3], frame C; NaN is absent."""
    triangles, weights = _onto(surface, points)
    absent = np.isnan(points).any(axis=1)
    triangles[absent], weights[absent] = -1, np.nan
    # The last digits of a fit change from run to run, and units are named by what they rest on.
    # A millionth of a triangle is a few nanometres.
    weights = _rounded(weights, 6)
    return Anchors(triangles, weights, surface.points(triangles, weights))


def _cast(surface: Surface, view: Sighting, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    origins, directions = camera.rays(view.pixels)
    origins = (origins - camera.translation_mm) @ view.rotation
    directions = directions @ view.rotation
    hits = surface.first_hits(origins, directions)
    missed = hits.triangles < 0
    points = hits.points.copy()
    for row in np.flatnonzero(missed):
        along = directions[row] / np.linalg.norm(directions[row])
        from_ray = surface.vertices - origins[row]
        from_ray = from_ray - (from_ray @ along)[:, None] * along
        distance = np.linalg.norm(from_ray, axis=1)
        nearest = int(distance.argmin())
        points[row] = surface.vertices[nearest] if distance[nearest] <= MAX_OFF_MM else np.nan
    return points, missed


def robust_mean(points: np.ndarray) -> np.ndarray:
    """Mean of the points no farther from their median than twice the median distance.

    [views, P, 3] -> [P, 3]; NaN where less than half of the views have a point.
    """
    known = np.isfinite(points).all(axis=2)
    enough = known.mean(axis=0) >= 0.5
    result = np.full(points.shape[1:], np.nan)
    for row in np.flatnonzero(enough):
        cloud = points[known[:, row], row]
        distance = np.linalg.norm(cloud - np.median(cloud, axis=0), axis=1)
        result[row] = cloud[distance <= 2 * np.median(distance) + 1e-9].mean(axis=0)
    return result


def _brought_back(points: np.ndarray, topology: Topology) -> tuple[np.ndarray, np.ndarray]:
    """Points far from any face moved to their place in the mean face, and which they were.

    A ray that passes the jaw by a hair's breadth meets the hair behind it. [P, 3] -> the same, bool [P].
    """
    known = np.isfinite(points).all(axis=1)
    if known.sum() < 3:
        return points, np.zeros(len(points), dtype=bool)
    reference = topology.surface_face() @ CAMERA_FROM_GRAPHICS
    fit = fit_similarity(reference[known], points[known])
    expected = fit.scale * reference @ fit.rotation.T + fit.translation
    astray = known & (np.linalg.norm(points - expected, axis=1) > MAX_ASTRAY_MM * fit.scale)
    return np.where(astray[:, None], expected, points), astray


def _onto(surface: Surface, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points of the surface that stand for points near it."""
    known = np.isfinite(points).all(axis=1)
    start = np.where(known[:, None], points, 0.0)
    depth = float(surface.vertices[:, 2].min()) - 1.0
    front = surface.first_hits(
        np.column_stack([start[:, :2], np.full(len(start), depth)]), np.tile([0.0, 0.0, 1.0], (len(start), 1))
    )
    triangles, weights = front.triangles.copy(), front.weights.copy()
    slide = np.linalg.norm(front.points - start, axis=1)
    far = known & ~(slide <= MAX_SLIDE_MM)
    triangles[far], weights[far] = surface.nearest(points[far])
    return triangles, weights


def _rms(distances: np.ndarray) -> float:
    known = distances[np.isfinite(distances)]
    return float(np.sqrt((known**2).mean())) if len(known) else float("nan")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors for all heads of a topology, from those that were found on a few of them.

What a detector finds on one head is off by some millimetres, and differently so on the next. Where all
have the same triangles, each head's anchors are places on the mean of the heads, too, and are averaged
there: from then on they mean the same place on every head and every expression.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from generator.errors import HeadError
from generator.geometry.rigid import fit_similarity
from generator.heads.mesh import HeadMesh, Material
from generator.landmarks.anchors import Anchors
from generator.landmarks.shared import SharedAnchors, mesh_key
from generator.landmarks.surface import Surface
from generator.landmarks.topology import Topology
from generator.placing.anchors import anchors_at, robust_mean
from generator.placing.levelling import level_together

FEWEST = 2
"""Heads of a topology below this each have their own anchors."""


@dataclass(frozen=True, eq=False)
class OwnAnchors:
    """A head with the anchors that were found on it alone.

    mesh: as read, but in frame U, mm, pivot at the origin, in the source's axes. anchors: their
    triangles are the mesh's. correction: R_U [3, 3] to where this head alone is level.
    """

    mesh: HeadMesh
    anchors: Anchors
    correction: np.ndarray


def share(heads: Iterable[OwnAnchors], topology: Topology, *, count: int, way: str) -> SharedAnchors:
    """Average what was found on heads of one topology; symmetric as the mean head is.

    count: triangles that they have in common, from the first; others may follow. way: see Anchors.
    Raises HeadError if their triangles differ, or there are fewer than two.
    """
    total: np.ndarray | None = None
    first: HeadMesh | None = None
    found: list[Anchors] = []
    corrections: list[np.ndarray] = []
    for head in heads:
        common = int(head.mesh.triangles[:count].max()) + 1
        vertices = head.mesh.vertices[:common]
        if first is None or total is None:
            first, total = head.mesh, np.zeros_like(vertices)
        if not np.array_equal(first.triangles[:count], head.mesh.triangles[:count]):
            raise HeadError("heads that share anchors have other triangles; build each for itself")
        total += vertices
        found.append(head.anchors)
        corrections.append(head.correction)
    if first is None or total is None or len(found) < FEWEST:
        raise HeadError(f"{len(found)} heads: anchors are shared by {FEWEST} or more")
    triangles = first.triangles[:count]
    surface = Surface(_plain(total / len(found), triangles))
    places = np.stack([_places(surface, anchors) for anchors in found])
    mean = anchors_at(surface, _symmetric(robust_mean(places), topology), topology)
    zero = level_together(np.stack(corrections))
    residual_mm = float(np.nanmedian(np.linalg.norm(places - mean.points, axis=2)))
    anchors = Anchors(
        triangles=mean.triangles,
        weights=mean.weights,
        points=mean.points,
        views=sum(one.views for one in found),
        off=round(float(np.mean([one.off for one in found]))),
        residual_px=float(np.sqrt(np.mean(np.square([one.residual_px for one in found])))),
        residual_mm=residual_mm,
        way=way,
    )
    return SharedAnchors(
        mesh=mesh_key(triangles),
        count=count,
        anchors=anchors,
        heads=len(found),
        # The last digits of a fit change from run to run, and units are named by what they rest on.
        correction=tuple(np.round(zero.correction, 9).reshape(-1).tolist()),
        correction_sd_deg=tuple(np.round(zero.sd_deg, 3).tolist()),
    )


def same_topology(meshes: Sequence[np.ndarray]) -> list[tuple[int, list[int]]]:
    """Which meshes have the same triangles, int [T, 3] each: how many those are, and the meshes' places.

    One that has more behind them, such as long hair, is among them, unless that is most of it.
    """
    groups: list[tuple[np.ndarray, list[int]]] = []
    for place in sorted(range(len(meshes)), key=lambda place: len(meshes[place])):
        triangles = meshes[place]
        for first, members in groups:
            count = len(first)
            if 2 * count >= len(triangles) and np.array_equal(triangles[:count], first):
                members.append(place)
                break
        else:
            groups.append((triangles, [place]))
    return [(len(first), sorted(members)) for first, members in groups]


def _places(surface: Surface, anchors: Anchors) -> np.ndarray:
    """A head's anchors on the mean head; NaN where it has none, or on what the others lack."""
    there = (anchors.triangles >= 0) & (anchors.triangles < len(surface.triangles))
    points = surface.points(np.where(there, anchors.triangles, 0), anchors.weights)
    return np.where(there[:, None], points, np.nan)


def _symmetric(points: np.ndarray, topology: Topology) -> np.ndarray:
    """Points [P, 3] averaged with their mirror image, laid over them. A face and its mirror image together
    have no better side."""
    pairs = topology.mirror_pairs()
    mirrored = points[pairs] * [-1.0, 1.0, 1.0]
    both = np.isfinite(points + mirrored).all(axis=1)
    if both.sum() < 3:
        return points
    fit = fit_similarity(mirrored[both], points[both])
    laid = fit.scale * mirrored @ fit.rotation.T + fit.translation
    return np.where(both[:, None], (points + laid) / 2, points)


def _plain(vertices: np.ndarray, triangles: np.ndarray) -> HeadMesh:
    nothing = np.zeros(len(triangles), dtype=np.int32)
    return HeadMesh(vertices, triangles, None, None, nothing, (Material("mean"),))

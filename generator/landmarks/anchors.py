# SPDX-License-Identifier: GPL-3.0-or-later
"""Surface anchors: the landmarks as points of a mesh, exact at any pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.geometry.rigid import fit_similarity
from generator.landmarks.topology import Topology

WEIGHTS_SUM = 1e-9
"""How near to 1 the barycentric weights of an anchor add up."""


WAYS = {
    "package": "those of all heads of its topology, which come with the package",
    "source": "those of all heads of its topology, found on the first of them in this dataset",
    "subject": "those of another expression of its subject, with the same triangles",
    "head": "found on this head alone",
}
"""Where anchors may come from."""


@dataclass(frozen=True, eq=False)
class Anchors:
    """The landmarks of a topology on one mesh; P of them.

    triangles    int32 [P], -1 where there is no anchor
    weights      float64 [P, 3], barycentric; NaN where there is none
    points       float64 [P, 3], frame C at pose zero of the mesh's own axes, mm; NaN where
                 there is none
    views        detections averaged
    off          anchors whose landmark fell beside the silhouette in most views, or past it onto
                 hair or shoulders behind
    residual_px  rms distance of the detections from the projected anchors, pixels
    residual_mm  median distance of the hits from the anchors: towards the silhouette a pixel is
                 centimetres deep, and their mean would tell of nothing else
    way          a key of WAYS: where they come from
    """

    triangles: np.ndarray
    weights: np.ndarray
    points: np.ndarray
    views: int = 0
    off: int = 0
    residual_px: float = float("nan")
    residual_mm: float = float("nan")
    way: str = "head"

    @property
    def absent(self) -> int:
        """Points without an anchor."""
        return int((self.triangles < 0).sum())

    @property
    def problems(self) -> list[str]:
        """What a user of the exact landmarks should know, a line each."""
        if not self.views:
            return ["no face was found near the front: landmarks_exact is NaN"]
        return [f"{self.absent} landmarks have no place on the mesh: NaN"] if self.absent else []

    def contradiction(self, topology: Topology) -> str:
        """What cannot be so whatever the mesh, or "": arrays of other shapes, weights that do not add up."""
        shapes = (self.triangles.shape, self.weights.shape, self.points.shape)
        if shapes != ((topology.count,), (topology.count, 3), (topology.count, 3)):
            return f"its anchors are not {topology.count} points"
        there = self.triangles >= 0
        if (np.isfinite(self.points).all(axis=1) != there).any():
            return "an anchor has a triangle and no place, or a place and no triangle"
        if (np.abs(self.weights[there].sum(axis=1) - 1) > WEIGHTS_SUM).any():
            return "the weights of an anchor do not add up to 1"
        return "" if self.way in WAYS else f"its anchors come from {self.way!r}, which is no way to find them"

    def asymmetry_mm(self, topology: Topology) -> float:
        """Rms distance of each anchor from the mirror image of its partner, after a rigid fit."""
        pairs = topology.mirror_pairs()
        mirrored = self.points[pairs] * [-1.0, 1.0, 1.0]
        both = np.isfinite(self.points + mirrored).all(axis=1)
        if both.sum() < 3:
            return float("nan")
        return fit_similarity(mirrored[both], self.points[both]).rms

    def turned(self, rotation: np.ndarray) -> np.ndarray:
        """The points after a rotation of the head, float64 [P, 3]. rotation: R_C [3, 3]."""
        return self.points @ np.asarray(rotation).T


def no_anchors(topology: Topology) -> Anchors:
    """Anchors of a head on which no face was found."""
    nothing = np.full((topology.count, 3), np.nan)
    return Anchors(np.full(topology.count, -1, dtype=np.int32), nothing, nothing)

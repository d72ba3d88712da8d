# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads of a topology that is known: they stand where its anchors say, and nobody needs to look."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement
from generator.heads.surroundings import head_triangles
from generator.landmarks.anchors import Anchors
from generator.landmarks.shared import SharedAnchors
from generator.landmarks.topology import Topology
from generator.placing.face import place_face
from generator.placing.levelling import Levelling
from generator.placing.looking import MAX_RESIDUAL, Face, agreement


def find_known(mesh: HeadMesh, known: Iterable[SharedAnchors], topology: Topology) -> SharedAnchors | None:
    """The shared anchors of a mesh, as read; None where there are none or they make no face of it.

    That a mesh has the triangles of others says nothing about where its vertices are: the landmarks have
    to lie as on a face.
    """
    for shared in known:
        if shared.fits(mesh.triangles):
            points = shared.points(mesh.vertices, mesh.triangles) @ CAMERA_FROM_GRAPHICS
            if agreement(points, topology)[1] <= MAX_RESIDUAL:
                return shared
    return None


def stand_known(head: Head, mesh: HeadMesh, shared: SharedAnchors, topology: Topology) -> Placement:
    """Axes, units, pivot and size of a head, as its topology's anchors say. mesh: as read.

    Raises HeadError as :func:`generator.placing.face.find_face` does.
    """
    points = shared.points(mesh.vertices, mesh.triangles)
    turn, residual = agreement(points @ CAMERA_FROM_GRAPHICS, topology)
    right, left, chin = points[[topology.right_eye_outer, topology.left_eye_outer, topology.chin]]
    return place_face(head, mesh, Face(right, left, chin, turn, residual))


def anchors_on(mesh: HeadMesh, placement: Placement, shared: SharedAnchors) -> Anchors:
    """The anchors of one head: the topology's, on its own surface.

    mesh: as read. Their triangles are those of the head alone, as of
    :func:`generator.placing.anchoring.anchor_head`, their points about the pivot in the source's axes.
    """
    placed = replace(placement, frame="source").normalise(mesh)
    there = shared.anchors.triangles
    kept = head_triangles(mesh, placement)
    left = np.where((there >= 0) & kept[there], np.cumsum(kept)[there] - 1, -1).astype(np.int32)
    absent = left[:, None] < 0
    points = shared.points(placed.vertices, mesh.triangles) @ CAMERA_FROM_GRAPHICS
    return replace(
        shared.anchors,
        triangles=left,
        weights=np.where(absent, np.nan, shared.anchors.weights),
        points=np.where(absent, np.nan, points),
    )


def level_known(anchors: Anchors, shared: SharedAnchors, topology: Topology) -> Levelling:
    """Pose zero of a head: its topology's, unless it was not aligned with the others of it."""
    correction = shared.correction_of(anchors.points, topology)
    return Levelling(correction, np.array(shared.correction_sd_deg))

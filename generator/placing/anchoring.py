# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the views that a head's anchors are taken from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.geometry.camera import SENSOR_MM, Camera
from generator.geometry.rotation import angles_from_rotation, graphics_rotation, rotation_from_angles
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.placement import STRAIGHT, Placement
from generator.heads.surroundings import head_alone
from generator.landmarks.anchors import Anchors, no_anchors
from generator.landmarks.detector import Detector
from generator.landmarks.facing import facing
from generator.landmarks.surface import Surface
from generator.landmarks.topology import Topology
from generator.placing.anchors import Sighting, find_anchors
from generator.placing.levelling import Levelling, level
from generator.placing.rendering import HeadRenderer, read_image
from generator.plan.settings import Look
from generator.plan.views import Pose, Views

POSES: tuple[Pose, ...] = (
    (0, 0, 0), (10, 0, 0), (-10, 0, 0), (0, 8, 0), (0, -8, 0), (6, 5, 5), (-6, 5, -5),
)  # fmt: skip
"""(yaw, pitch, roll) of the views, degrees: near the front, where the detector is at its best,
and spread, because its errors there change with the pose."""

PIXELS, LENS_MM = 384, 400.0
"""From three metres: a detector reads a face that is nearer some degrees lower."""
LOOK = Look(samples=2, light_yaw_deg=0.0, light_pitch_deg=20.0, ambient=0.5)

CANONICAL_SD_DEG = (0.3, 3.2, 0.1)
"""Standard deviation of yaw, pitch and roll of frame "canonical" over heads whose axes agree: it is the fit
of a mean face to each head's own anchors, and a profile leaves open where its pitch is zero."""

WINDOW = 3.0
"""Side of the views at the pivot, in outer-eye distances."""


def anchor_camera(eye_distance_mm: float) -> Camera:
    """The camera of the views."""
    distance = WINDOW * eye_distance_mm * LENS_MM / SENSOR_MM
    return Camera.square(PIXELS, LENS_MM, distance)


def anchor_views(
    mesh: HeadMesh,
    camera: Camera,
    renderer: HeadRenderer,
    detector: Detector,
    scratch: Path,
    turned_deg: tuple[float, ...] = STRAIGHT,
) -> list[Sighting]:
    """What the detector finds on each view and on its mirror image; nothing where there is no face.

    mesh: frame U, mm, pivot at the origin. turned_deg: of the face in it.
    """
    package = scratch / "anchor.npz"
    save_package(mesh, package)
    pairs = detector.topology.mirror_pairs()
    sightings = []
    poses = _near_front(turned_deg)
    views = Views(poses, (camera,), (LOOK,))
    for angles, path in zip(poses, renderer.render(package, views), strict=True):
        image = read_image(path)
        rotation = rotation_from_angles(np.array(angles, dtype=np.float64))
        found = detector.detect(image)
        if found is not None:
            sightings.append(Sighting(rotation, found.astype(np.float64)))
        # A network has a better and a worse side; a face and its mirror image together do not.
        mirrored = detector.detect(np.ascontiguousarray(image[:, ::-1]))
        if mirrored is not None:
            landmarks = mirrored[pairs].astype(np.float64)
            landmarks[:, 0] = camera.width - landmarks[:, 0]
            sightings.append(Sighting(rotation, landmarks))
    return sightings


def _near_front(turned_deg: tuple[float, ...]) -> tuple[Pose, ...]:
    """Poses that show a face that is turned in its mesh as POSES show one that looks along its axes."""
    if turned_deg == STRAIGHT:
        return POSES
    back = rotation_from_angles(np.array(turned_deg)).T
    turned = angles_from_rotation(rotation_from_angles(np.array(POSES)) @ back)
    return tuple((yaw, pitch, roll) for yaw, pitch, roll in turned.tolist())


def anchor_head(
    mesh: HeadMesh, placement: Placement, renderer: HeadRenderer, detector: Detector, scratch: Path
) -> tuple[Anchors, Levelling | None]:
    """Anchors of one expression and what they say about pose zero.

    mesh: as read. The anchors' points are about the pivot, in the mesh's own axes
    (frame C at pose zero of frame = "source").
    """
    placed = replace(placement, frame="source").normalise(head_alone(replace(mesh, scene=None), placement))
    camera = anchor_camera(placement.eye_distance_mm)
    views = anchor_views(placed, camera, renderer, detector, scratch, placement.turned_deg)
    if not views:
        return no_anchors(detector.topology), None
    anchors = find_anchors(Surface(placed), views, camera, detector.topology)
    return anchors, level(views, detector.topology)


def level_head(
    head: Head, placement: Placement, anchors: Anchors, levelling: Levelling | None, topology: Topology
) -> Placement:
    """A placement with the pose zero of its frame; see docs/truth.md.

    anchors: of the head that decides for its subject. Raises HeadError where the head cannot be levelled
    though its frame asks for it.
    """
    if placement.frame == "canonical":
        face = facing(anchors.points, topology)
        levelling = None if face is None else Levelling(graphics_rotation(face.T), np.array(CANONICAL_SD_DEG))
    if levelling is None:
        if placement.frame != "source":
            raise HeadError(
                f"{head.mesh_path}: cannot be levelled: too few landmarks found a place on the mesh; "
                'use frame = "source" or a mesh that shows the whole face'
            )
        return placement
    return replace(
        placement,
        # The last digits of a fit change from run to run, and units are named by what they rest on.
        correction=tuple((np.round(levelling.correction, 9) + 0.0).reshape(-1).tolist()),
        correction_sd_deg=tuple(np.round(levelling.sd_deg, 3).tolist()),
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the views that a head's anchors are taken from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from generator.errors import HeadError, WorkerError
from generator.geometry.camera import Camera
from generator.geometry.rotation import rotation_from_angles
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.landmarks.anchors import Anchors, View, cast_views, find_anchors, no_anchors
from generator.landmarks.detector import Detector
from generator.landmarks.reference_face import mirror_pairs
from generator.landmarks.surface import Surface
from generator.placing.face import Prepared
from generator.placing.levelling import Levelling, level
from generator.placing.rendering import HeadRenderer
from generator.plan.render_settings import RenderSettings

VIEWS = ((0, 0, 0), (10, 0, 0), (-10, 0, 0), (0, 8, 0), (0, -8, 0), (6, 5, 5), (-6, 5, -5))
"""(yaw, pitch, roll) of the views, degrees: near the front, where the detector is at its best,
and spread, because its errors there change with the pose."""

LOOK = RenderSettings(
    resolution=384, lens_mm=200.0, samples=2, light_yaw_deg=0.0, light_pitch_deg=20.0, ambient=0.5
)

WINDOW = 3.0
"""Side of the views at the pivot, in outer-eye distances."""


def anchor_camera(eye_distance_mm: float) -> Camera:
    """The camera of the views."""
    distance = WINDOW * eye_distance_mm * LOOK.lens_mm / 36.0
    return Camera(LOOK.resolution, LOOK.lens_mm, distance)


def anchor_views(
    mesh: HeadMesh, camera: Camera, renderer: HeadRenderer, detector: Detector, scratch: Path
) -> list[View]:
    """What the detector finds on each view and on its mirror image; nothing where there is no face.

    mesh: frame U, mm, pivot at the origin.
    """
    package = scratch / "anchor.npz"
    save_package(mesh, package)
    pairs = mirror_pairs()
    views = []
    frames = renderer.render(package, LOOK, camera.distance_mm, VIEWS)
    for angles, path in zip(VIEWS, frames, strict=True):
        image = cv2.imread(str(path))
        path.unlink()
        if image is None:
            raise WorkerError(f"{path}: the render worker left no readable frame")
        rotation = rotation_from_angles(np.array(angles, dtype=np.float64))
        frame = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
        found = detector.detect(frame)
        if found is not None:
            views.append(View(rotation, found[:, :2].astype(np.float64)))
        # A network has a better and a worse side; a face and its mirror image together do not.
        mirrored = detector.detect(np.ascontiguousarray(frame[:, ::-1]))
        if mirrored is not None:
            pixels = mirrored[pairs, :2].astype(np.float64)
            pixels[:, 0] = camera.resolution - pixels[:, 0]
            views.append(View(rotation, pixels))
    return views


def anchor_head(
    mesh: HeadMesh, prepared: Prepared, renderer: HeadRenderer, detector: Detector, scratch: Path
) -> tuple[Anchors, Levelling | None]:
    """Anchors of one expression and what they say about pose zero.

    mesh: as read. The anchors' points are about the pivot, in the mesh's own axes
    (frame C at pose zero of frame = "source").
    """
    placed = replace(prepared, frame="source").normalise(mesh)
    camera = anchor_camera(prepared.eye_distance_mm)
    views = anchor_views(placed, camera, renderer, detector, scratch)
    if not views:
        return no_anchors(), None
    surface = Surface(placed)
    anchors = find_anchors(surface, views, camera)
    return anchors, level(anchors.points, cast_views(surface, views, camera))


def level_head(head: Head, prepared: Prepared, levelling: Levelling | None, frame: str) -> Prepared:
    """What preparing found, with pose zero. HeadError if frame is "canonical" and there is none."""
    if levelling is None:
        if frame == "canonical":
            raise HeadError(
                f"{head.mesh_path}: cannot be levelled: too few landmarks found a place on the mesh; "
                'use frame = "source" or a mesh that shows the whole face'
            )
        return replace(prepared, frame=frame)
    return replace(
        prepared,
        frame=frame,
        # The last digits of a fit change from run to run, and units are named by what they rest on.
        correction=tuple(np.round(levelling.correction, 9).reshape(-1).tolist()),
        correction_sd_deg=tuple(np.round(levelling.sd_deg, 3).tolist()),
    )

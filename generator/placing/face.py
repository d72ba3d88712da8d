# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the face of a head: its axes, its units, its centre and its size.

Heads come with shoulders, in any unit and on any origin, so nothing is read off
the mesh's box. The head is rendered from the front, the detector finds the
face, and the landmarks that matter are cast back onto the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.geometry.camera import Camera
from generator.geometry.raycast import first_hits
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.placement import Placement
from generator.heads.units import CANDIDATE_AXES, MM_PER_UNIT, axes_rotation, guess_units
from generator.landmarks.detector import Detector
from generator.landmarks.topology import Topology
from generator.placing.rendering import HeadRenderer, read_image
from generator.plan.settings import Look
from generator.plan.views import View, Views

PIVOT_DEPTH = 1.00
"""Depth of the ear axis behind the outer eye corners, in outer-eye distances.

About 90 mm for eyes 90 mm apart; a convention, see docs/heads.md.
"""

REACH = 2.0
"""Vertices farther from the pivot than this many eye distances are not the head."""

MAX_TILT_DEG = 40.0
"""A face turned more than this from the front means the axes are wrong."""

_PIXELS, _LENS_MM = 384, 200.0
_LOOK = Look(samples=4, light_yaw_deg=0.0, light_pitch_deg=20.0, ambient=0.5)
_WINDOWS = (1.0, 0.6, 0.36, 0.22)
"""Share of the mesh's height that is looked at, from the crown down: a head, a bust, a body."""

_FACE_WINDOW = 3.4
"""Side of the second, sharp look, in outer-eye distances."""


def find_face(
    head: Head, mesh: HeadMesh, renderer: HeadRenderer, detector: Detector, scratch: Path
) -> Placement:
    """Find the face of one head; see the module's docstring.

    Raises HeadError if no face is found from the front, or its size fits no unit.
    """
    if head.up and head.forward:
        axes = [(head.up, head.forward)]
    else:
        axes = [
            (up, forward)
            for up, forward in CANDIDATE_AXES
            if head.up in (None, up) and head.forward in (None, forward)
        ]
    for up, forward in axes:
        turned = replace(mesh, vertices=mesh.vertices @ axes_rotation(up, forward).T)
        face = _find_face(turned, renderer, detector, scratch)
        if face is not None:
            return _measure(head, turned, face, up, forward, guessed=(up, forward) != axes[0])
    tried = "" if len(axes) == 1 else f" in any of {len(axes)} orientations"
    raise HeadError(
        f"{head.mesh_path}: no face was found from the front{tried}; "
        "check the mesh and its texture, or give --up and --forward"
    )


@dataclass(frozen=True)
class _Face:
    """Points on the surface, frame U, source units."""

    right_eye: np.ndarray
    left_eye: np.ndarray
    chin: np.ndarray


def _measure(head: Head, mesh: HeadMesh, face: _Face, up: str, forward: str, *, guessed: bool) -> Placement:
    eyes = float(np.linalg.norm(face.left_eye - face.right_eye))
    notes = []
    if head.units is not None:
        units, scale = head.units, MM_PER_UNIT[head.units]
    else:
        units, scale = guess_units(eyes)
        notes.append(f"units guessed: {units} (outer eye corners {eyes:.4g} apart)")
    if guessed:
        notes.append(f"axes guessed: up {up}, forward {forward}")
    middle = (face.left_eye + face.right_eye) / 2
    pivot = middle - [0.0, 0.0, PIVOT_DEPTH * eyes]
    from_pivot = mesh.vertices - pivot
    reach = np.linalg.norm(from_pivot, axis=1)
    is_head = (mesh.vertices[:, 1] >= face.chin[1] - 0.1 * eyes) & (reach <= REACH * eyes)
    # Rounded to hundredths of a millimetre: far below what a detector can tell,
    # and the same numbers are then printed, stored and used.
    in_source_axes = pivot @ axes_rotation(up, forward)
    step = 0.01 / scale
    return Placement(
        units=units,
        mm_per_unit=scale,
        up=up,
        forward=forward,
        pivot=tuple(np.round(np.round(in_source_axes / step) * step, 9).tolist()),
        radius_mm=round(float(reach[is_head].max()) * scale, 2),
        eye_distance_mm=round(eyes * scale, 2),
        notes=tuple(notes),
    )


def _find_face(mesh: HeadMesh, renderer: HeadRenderer, detector: Detector, scratch: Path) -> _Face | None:
    for centre, side in _windows(mesh):
        coarse = _look(mesh, centre, side, renderer, detector, scratch)
        if coarse is None:
            continue
        eyes = (coarse.left_eye + coarse.right_eye) / 2
        width = float(np.linalg.norm(coarse.left_eye - coarse.right_eye))
        sharp = _look(mesh, eyes, _FACE_WINDOW * width, renderer, detector, scratch)
        return sharp if sharp is not None else coarse
    return None


def _windows(mesh: HeadMesh) -> Iterator[tuple[np.ndarray, float]]:
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    whole = float((high - low)[:2].max())
    for share in _WINDOWS:
        side = 1.1 * share * whole
        middle = (low + high) / 2
        if share < 1.0:
            middle[1] = high[1] - 0.45 * side
        yield middle, side


def _look(
    mesh: HeadMesh,
    centre: np.ndarray,
    side: float,
    renderer: HeadRenderer,
    detector: Detector,
    scratch: Path,
) -> _Face | None:
    """Render a square window of the mesh (frame U, any unit) from the front and find the face."""
    mm = 300.0 / side
    seen = replace(mesh, vertices=(mesh.vertices - centre) * mm)
    # From outside everything: nothing of the mesh may lie behind the camera.
    distance = max(150.0 * _LENS_MM / 18.0, float(seen.vertices[:, 2].max()) * 1.1)
    camera = Camera.square(_PIXELS, _LENS_MM, distance)
    package = scratch / "look.npz"
    save_package(seen, package)
    [path] = renderer.render(package, Views.of([View((0.0, 0.0, 0.0), camera, _LOOK)]))
    landmarks = detector.detect(read_image(path))
    if landmarks is None or not _is_frontal(landmarks, detector.topology):
        return None
    points = detector.topology
    pixels = landmarks[[points.right_eye_outer, points.left_eye_outer, points.chin], :2]
    origins, rays = camera.rays(pixels)
    vertices = seen.vertices @ CAMERA_FROM_GRAPHICS + camera.translation_mm
    hits = first_hits(origins, rays, vertices, mesh.triangles)
    if np.isnan(hits).any():
        return None
    found = (hits - camera.translation_mm) @ CAMERA_FROM_GRAPHICS / mm + centre
    return _Face(*found)


def _is_frontal(landmarks: np.ndarray, points: Topology) -> bool:
    right, left = landmarks[points.right_eye_outer], landmarks[points.left_eye_outer]
    across, down = left - right, landmarks[points.chin] - (left + right) / 2
    nose = landmarks[points.nose_tip] - (left + right) / 2
    aligned = np.cos(np.deg2rad(MAX_TILT_DEG))
    return bool(
        across[0] > aligned * np.linalg.norm(across)
        and down[1] > aligned * np.linalg.norm(down)
        and nose[2] < 0
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a face may look to: what the detector finds on a mesh from directions all round."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import cv2
import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.rotation import (
    CAMERA_FROM_GRAPHICS,
    angles_from_rotation,
    geodesic_deg,
    rotation_from_angles,
)
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.landmarks.surface import Surface
from generator.placing.looking import LENS_MM, LOOK, MAX_RESIDUAL, Eyes, agreement
from generator.placing.rendering import read_image
from generator.plan.views import View, Views

PIXELS = 256
_LOOK = replace(LOOK, samples=1)

APART_DEG = 30.0
"""Sights that differ by more than this are of different faces."""

MOST = 3
"""Faces that are worth another look."""

UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0])

CLOSER = (0.5, 0.25)
"""Share of a mesh that is looked at from its ends, where its whole shows no face: of a body."""


@dataclass(frozen=True, eq=False)
class Sight:
    """A face on one picture. turn: R_C [3, 3] from the mean face to it in the mesh's axes.

    middle: between the outer eye corners, frame U, the mesh's units; width: their distance.
    residual: see :func:`generator.placing.looking.agreement`.
    """

    turn: np.ndarray
    middle: np.ndarray
    width: float
    residual: float


def find_around(mesh: HeadMesh, eyes: Eyes) -> list[Sight]:
    """The faces that are seen on a mesh (frame U, any unit), the likeliest first.

    The last is the likeliest upside down: detectors find faces that stand on their heads, too.
    """
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low))
    mm = 300.0 / size
    seen = replace(mesh, vertices=(mesh.vertices - centre) * mm)
    package = eyes.scratch / "around.npz"
    save_package(seen, package)
    surface = Surface(seen)
    # Every picture is looked at upright and turned: the detector wants crowns up.
    for views, spins in ((_all_round(), 8), (_ends(high - low, size), 4)):
        pictures = eyes.renderer.render(package, views)
        sights = [
            sight
            for view, path in zip(views, pictures, strict=True)
            for sight in _sights(read_image(path), spins, view, surface, eyes)
        ]
        if sights:
            best = likeliest(sights)
            best.append(replace(best[0], turn=best[0].turn @ UPSIDE_DOWN))
            return [replace(s, middle=s.middle / mm + centre, width=s.width / mm) for s in best]
    return []


def likeliest(sights: Sequence[Sight]) -> list[Sight]:
    """Those that agree best with a face, one of each face."""
    chosen: list[Sight] = []
    for sight in sorted(sights, key=lambda sight: sight.residual):
        if all(geodesic_deg(other.turn, sight.turn) > APART_DEG for other in chosen):
            chosen.append(sight)
    return chosen[:MOST]


def _all_round() -> Views:
    """The whole from the faces, edges and corners of a cube."""
    steps = [step for step in product((-1, 0, 1), repeat=3) if any(step)]
    camera = Camera.square(PIXELS, LENS_MM, 150.0 * LENS_MM / 18.0)
    return Views(tuple(_pose(np.array(step, dtype=np.float64)) for step in steps), (camera,), (_LOOK,))


def _ends(extent: np.ndarray, size: float) -> Views:
    """Both ends of the longest axis, closer, from around it."""
    axis = int(np.argmax(extent))
    poses, cameras = [], []
    for end, share, step in product((1.0, -1.0), CLOSER, range(8)):
        side = share * float(extent[axis])
        angle = np.deg2rad(45.0 * step)
        towards = np.roll([0.0, np.cos(angle), np.sin(angle)], axis)
        pose = _pose(towards)
        target = np.zeros(3)
        target[axis] = end * (float(extent[axis]) - 0.9 * side) / 2 * 300.0 / size
        distance = 150.0 * LENS_MM / 18.0
        lens = LENS_MM * size / side
        focal = PIXELS * lens / 36.0
        place = rotation_from_angles(np.array(pose)) @ (CAMERA_FROM_GRAPHICS @ target)
        depth = place[2] + distance
        principal = PIXELS / 2 - place[:2] / depth * focal
        cameras.append(Camera(PIXELS, PIXELS, lens, distance, principal_px=(principal[0], principal[1])))
        poses.append(pose)
    return Views(tuple(poses), tuple(cameras), (_LOOK,))


def _pose(towards: np.ndarray) -> tuple[float, float, float]:
    """Angles that turn a direction (frame U) of a mesh to the camera, its crown up where it has one."""
    z = towards / np.linalg.norm(towards)
    up = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([0.0, 0.0, -np.sign(z[1])])
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    turned = np.stack([x, np.cross(z, x), z])
    yaw, pitch, roll = angles_from_rotation(CAMERA_FROM_GRAPHICS @ turned @ CAMERA_FROM_GRAPHICS)
    return float(yaw), float(pitch), float(roll)


def _sights(image: np.ndarray, spins: int, view: View, surface: Surface, eyes: Eyes) -> Iterator[Sight]:
    topology, camera = eyes.detector.topology, view.camera
    rotation = rotation_from_angles(np.array(view.pose))
    middle = np.array([PIXELS, PIXELS]) / 2
    for angle in np.arange(spins) * (360.0 / spins):
        # OpenCV counts from the centres of pixels, and turns against the clock.
        matrix = cv2.getRotationMatrix2D(tuple(middle - 0.5), angle, 1.0)
        spun = cv2.warpAffine(image, matrix, (PIXELS, PIXELS), borderMode=cv2.BORDER_REPLICATE)
        landmarks = eyes.detector.detect(spun)
        if landmarks is None:
            continue
        pixels = (landmarks[:, :2].astype(np.float64) - middle) @ matrix[:, :2] + middle
        origins, rays = camera.rays(pixels)
        points = surface.first_hits((origins - camera.translation_mm) @ rotation, rays @ rotation).points
        turn, residual = agreement(points, topology)
        right, left = points[topology.right_eye_outer], points[topology.left_eye_outer]
        if residual <= MAX_RESIDUAL and np.isfinite(right + left).all():
            between = CAMERA_FROM_GRAPHICS @ (right + left) / 2
            yield Sight(turn, between, float(np.linalg.norm(left - right)), residual)

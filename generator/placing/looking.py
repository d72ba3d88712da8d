# SPDX-License-Identifier: GPL-3.0-or-later
"""One look at a mesh from the front: the face that the detector finds, cast onto the surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.raycast import first_hits
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, graphics_rotation
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.landmarks.detector import Detector
from generator.landmarks.facing import FEWEST_SHARE
from generator.landmarks.surface import Surface
from generator.landmarks.topology import Topology
from generator.placing.rendering import HeadRenderer, read_image
from generator.plan.settings import Look
from generator.plan.views import View, Views

MAX_TILT_DEG = 40.0
"""A face turned more than this from the front means the axes are wrong."""

MAX_RESIDUAL = 0.12
"""Of a face, between its points on the surface and the mean face: rms, in outer-eye distances. Faces have
0.03 to 0.07; one that is seen upside down has 0.1, and less the other way up."""

MIN_NOSE = 0.1
"""How far the tip of the nose stands out of the plane of eyes and chin, in outer-eye distances."""

PIXELS, LENS_MM = 384, 200.0
LOOK = Look(samples=4, light_yaw_deg=0.0, light_pitch_deg=20.0, ambient=0.5)


@dataclass(frozen=True)
class Eyes:
    """Someone who looks at heads. scratch: an existing folder."""

    renderer: HeadRenderer
    detector: Detector
    scratch: Path


@dataclass(frozen=True, eq=False)
class Face:
    """Points on the surface, frame U, source units.

    turn, residual: of :func:`agreement`, where it was looked at closely.
    """

    right_eye: np.ndarray
    left_eye: np.ndarray
    chin: np.ndarray
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    residual: float = float("inf")

    def seen_from(self, turn: np.ndarray) -> Face:
        """The same after a small turn of the axes, R_C [3, 3]."""
        return self.rotated(graphics_rotation(turn.T))

    def rotated(self, rotation: np.ndarray) -> Face:
        """The same in other axes. rotation: R_U [3, 3]."""
        own = rotation.T
        return Face(self.right_eye @ own, self.left_eye @ own, self.chin @ own, residual=self.residual)

    @property
    def middle(self) -> np.ndarray:
        """Between the outer eye corners."""
        return (self.left_eye + self.right_eye) / 2

    @property
    def width(self) -> float:
        """Between the outer eye corners."""
        return float(np.linalg.norm(self.left_eye - self.right_eye))


def look(
    mesh: HeadMesh, centre: np.ndarray, side: float, eyes: Eyes, *, closely: bool = False
) -> Face | None:
    """Render a square window of the mesh (frame U, any unit) from the front and find the face.

    closely: find its turn, too.
    """
    mm = 300.0 / side
    seen = replace(mesh, vertices=(mesh.vertices - centre) * mm, scene=None)
    # From outside everything: nothing of the mesh may lie behind the camera.
    distance = max(150.0 * LENS_MM / 18.0, float(seen.vertices[:, 2].max()) * 1.1)
    camera = Camera.square(PIXELS, LENS_MM, distance)
    package = eyes.scratch / "look.npz"
    save_package(seen, package)
    [path] = eyes.renderer.render(package, Views.of([View((0.0, 0.0, 0.0), camera, LOOK)]))
    image = read_image(path)
    landmarks = eyes.detector.detect(image)
    points = eyes.detector.topology
    if landmarks is None or not _is_frontal(landmarks, points):
        return None
    pixels = landmarks[[points.right_eye_outer, points.left_eye_outer, points.chin], :2]
    origins, rays = camera.rays(pixels)
    vertices = seen.vertices @ CAMERA_FROM_GRAPHICS + camera.translation_mm
    hits = first_hits(origins, rays, vertices, mesh.triangles)
    if np.isnan(hits).any():
        return None
    found = Face(*((hits - camera.translation_mm) @ CAMERA_FROM_GRAPHICS / mm + centre))
    if not closely:
        return found
    surface = Surface(seen)

    def agrees(pixels: np.ndarray) -> tuple[np.ndarray, float]:
        origins, rays = camera.rays(pixels.astype(np.float64))
        return agreement(surface.first_hits(origins - camera.translation_mm, rays).points, points)

    turn, residual = agrees(landmarks[:, :2])
    # Detectors find faces that stand on their heads; those are more of a face the other way up.
    turned_over = eyes.detector.detect(np.ascontiguousarray(image[::-1, ::-1]))
    if turned_over is not None and agrees(PIXELS - turned_over[:, :2])[1] < residual:
        residual = float("inf")
    return replace(found, turn=turn, residual=residual)


def agreement(surface: np.ndarray, topology: Topology) -> tuple[np.ndarray, float]:
    """How far what was found is from a face.

    surface: float [P, 3], frame C, NaN where nothing is. Returns R_C from the mean face to the points,
    and the rms distance between the two in outer-eye distances: infinite where too few points lie on
    the surface, or the nose does not stand out.
    """
    nothing = np.eye(3), float("inf")
    mean = topology.surface_face() @ CAMERA_FROM_GRAPHICS
    known = np.isfinite(surface).all(axis=1)
    if known.sum() < FEWEST_SHARE * topology.count:
        return nothing
    fit = fit_similarity(mean[known], surface[known])
    off = np.linalg.norm(fit.scale * mean @ fit.rotation.T + fit.translation - surface, axis=1)
    # Past the silhouette a ray meets an ear, or hair: that is not what the rest is judged by.
    known &= off <= 2.5 * np.nanmedian(off)
    if known.sum() < FEWEST_SHARE * topology.count:
        return nothing
    fit = fit_similarity(mean[known], surface[known])
    level = (surface - fit.translation) @ fit.rotation / fit.scale
    width = float(np.linalg.norm(mean[topology.left_eye_outer] - mean[topology.right_eye_outer]))
    if not _nose(level, topology) >= MIN_NOSE * width:
        return nothing
    return fit.rotation, fit.rms / fit.scale / width


def _nose(points: np.ndarray, topology: Topology) -> float:
    """How far the tip of the nose stands out of the plane of eyes and chin; NaN where one is missing."""
    right, left, chin, nose = points[
        [topology.right_eye_outer, topology.left_eye_outer, topology.chin, topology.nose_tip]
    ]
    outwards = np.cross(chin - left, right - left)
    return -float((nose - left) @ outwards / np.linalg.norm(outwards)) * float(np.sign(outwards[2]))


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

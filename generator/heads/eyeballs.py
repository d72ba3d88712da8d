# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs and a mouth for scans that end at the lids and lips, such as FaceScape's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from generator.heads.boundary import FaceHoles, find_face_holes
from generator.heads.mesh import HeadMesh, Material

EYE_RADIUS_MM = 12.0
"""Of an adult eyeball (axial length 24 mm)."""

MIN_EYE_RADIUS_MM = 5.0
LID_CLEARANCE_MM = 0.3
_NEAR_MM = 22.0
_RINGS, _SEGMENTS = 24, 32
_IRIS_DEG, _PUPIL_DEG = 29.0, 10.0
_TEXTURE_PX = 512


def add_eyeballs(mesh: HeadMesh, scratch: Path) -> HeadMesh:
    """The mesh with a ball behind each eye hole and a dark pocket behind the mouth.

    The lids are joined to the balls by a strip, so that no view through the
    gap shows the background.

    Parameters
    ----------
    mesh: frame U, millimetres, welded. Expects two eye holes.
    scratch: the eyes' texture is written there.

    Returns
    -------
    The mesh with the materials "eye", "lid" and, with an open mouth loop,
    "mouth" added; the mesh with a problem noted where no eye holes are found.
    """
    holes = find_face_holes(mesh.vertices, mesh.triangles)
    if holes is None:
        return replace(mesh, problems=(*mesh.problems, "no pair of eye holes found; no eyeballs added"))
    texture = scratch / "eye.png"
    paint_eye(texture)
    parts = _Parts(mesh)
    parts.material(Material("eye", (0.85, 0.82, 0.79), texture))
    balls = [eyeball(mesh, loop) for loop in (holes.left, holes.right)]
    for centre, radius in balls:
        ball, triangles, uv = _sphere(centre, radius)
        parts.add(ball, triangles, uv)
    parts.material(Material("lid", (0.62, 0.38, 0.34)))
    for loop, (centre, radius) in zip((holes.left, holes.right), balls, strict=True):
        parts.strip(loop, _inside_ball(mesh.vertices[loop], centre, radius))
    _add_mouth(parts, mesh, holes)
    return parts.result()


def eyeball(mesh: HeadMesh, loop: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius, in mm, of the ball that the lids around ``loop`` lie on.

    Least squares over the lid margin for a ball of an eye's radius, held near
    the place straight behind the hole because a closed eye is a line that fixes
    no ball; then the radius shrinks until nothing of the lids is inside.
    """
    lid = mesh.vertices[loop]
    behind = (lid.min(0) + lid.max(0)) / 2
    behind[2] = lid[:, 2].mean() - EYE_RADIUS_MM
    target = EYE_RADIUS_MM + LID_CLEARANCE_MM
    centre = behind.copy()
    for _ in range(20):
        offset = centre - lid
        distance = np.linalg.norm(offset, axis=1)
        jacobian = np.concatenate([offset / distance[:, None], np.eye(3) * np.sqrt(0.1 * len(lid))])
        residual = np.concatenate([distance - target, (centre - behind) * np.sqrt(0.1 * len(lid))])
        centre = centre - np.linalg.lstsq(jacobian, residual, rcond=None)[0]
    corners = mesh.vertices[mesh.triangles]
    near = corners[(np.linalg.norm(corners.mean(1) - centre, axis=1) < _NEAR_MM)]
    edges = (near + np.roll(near, 1, axis=1)) / 2
    samples = np.concatenate([near, edges, near.mean(1, keepdims=True)], axis=1)
    distance = np.linalg.norm(samples.reshape(-1, 3) - centre, axis=1)
    radius = float(np.clip(distance.min() - LID_CLEARANCE_MM, MIN_EYE_RADIUS_MM, EYE_RADIUS_MM))
    return centre, radius


def paint_eye(path: Path) -> None:
    """Write the texture of an eyeball: angle from the gaze grows linearly from the image's centre."""
    axis = (np.arange(_TEXTURE_PX) + 0.5) / _TEXTURE_PX * 2 - 1
    x, y = np.meshgrid(axis, axis)
    degrees = np.hypot(x, y) * 180.0
    spokes = 0.5 + 0.5 * np.sin(np.arctan2(y, x) * 47)
    sclera = np.array([0.87, 0.84, 0.81])
    iris = np.array([0.34, 0.21, 0.12])
    image = np.broadcast_to(sclera, (_TEXTURE_PX, _TEXTURE_PX, 3)).copy()
    # Lids shade the white towards its sides.
    image *= (1.0 - 0.35 * np.clip((degrees - 35.0) / 50.0, 0, 1))[..., None]
    inside = iris * (0.75 + 0.35 * spokes + 0.25 * np.clip((20.0 - degrees) / 10.0, 0, 1))[..., None]
    limbus = np.clip((_IRIS_DEG - degrees) / 5.0, 0.25, 1)[..., None]
    image = _blend(image, inside * limbus, _IRIS_DEG - degrees)
    image = _blend(image, np.full(3, 0.02), _PUPIL_DEG - degrees)
    glint = np.hypot(x * 180 + 8, y * 180 + 9)
    image = _blend(image, np.full(3, 0.95), 3.0 - glint)
    Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path)


def _blend(below: np.ndarray, above: np.ndarray, degrees_inside: np.ndarray) -> np.ndarray:
    weight = np.clip(degrees_inside + 0.5, 0, 1)[..., None]
    return below * (1 - weight) + above * weight


def _sphere(centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, outward triangles and corner uv of a ball whose pole looks along +Z."""
    theta = np.linspace(0, np.pi, _RINGS + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, _SEGMENTS, endpoint=False)
    ring, turn = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    side = np.stack([np.sin(ring) * np.cos(turn), np.sin(ring) * np.sin(turn), np.cos(ring)], axis=1)
    unit = np.concatenate([[[0, 0, 1.0]], side, [[0, 0, -1.0]]])
    angle = np.concatenate([[0], ring, [np.pi]])[:, None]
    turn = np.concatenate([[0], turn, [0]])[:, None]
    uv = 0.5 + 0.5 * angle / np.pi * np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
    here = np.arange(_SEGMENTS)
    after = (here + 1) % _SEGMENTS
    last = 1 + (_RINGS - 2) * _SEGMENTS
    faces = [np.stack([np.zeros_like(here), 1 + here, 1 + after], axis=1)]
    for start in range(1, last, _SEGMENTS):
        faces.append(np.stack([start + here, start + _SEGMENTS + here, start + _SEGMENTS + after], axis=1))
        faces.append(np.stack([start + here, start + _SEGMENTS + after, start + after], axis=1))
    faces.append(np.stack([last + after, last + here, np.full_like(here, len(unit) - 1)], axis=1))
    triangles = np.concatenate(faces)
    return centre + radius * unit, triangles, uv[triangles]


def _inside_ball(lid: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    offset = lid - centre
    return centre + offset * (0.9 * radius / np.linalg.norm(offset, axis=1, keepdims=True))


def _add_mouth(parts: _Parts, mesh: HeadMesh, holes: FaceHoles) -> None:
    if holes.mouth is None:
        return
    lips = mesh.vertices[holes.mouth]
    parts.material(Material("mouth", (0.16, 0.06, 0.06)))
    centre = lips.mean(0) - np.array([0.0, 0.0, 0.5 * np.ptp(lips[:, 0])])
    inner = parts.strip(holes.mouth, centre + 0.6 * (lips - lips.mean(0)))
    apex = parts.point(centre)
    parts.add_triangles(np.stack([inner, np.roll(inner, -1), np.full_like(inner, apex)], axis=1))


class _Parts:
    """Grows a mesh by pieces that share one material at a time."""

    def __init__(self, mesh: HeadMesh) -> None:
        self.mesh = mesh
        self.vertices = [mesh.vertices]
        self.count = len(mesh.vertices)
        self.triangles = [mesh.triangles]
        self.uv = [np.zeros((len(mesh.triangles), 3, 2)) if mesh.uv is None else mesh.uv]
        self.index = [mesh.material_index]
        self.materials = list(mesh.materials)

    def material(self, material: Material) -> None:
        self.materials.append(material)

    def add(self, vertices: np.ndarray, triangles: np.ndarray, uv: np.ndarray) -> None:
        start = self.count
        self.vertices.append(vertices)
        self.count += len(vertices)
        self.add_triangles(triangles + start, uv)

    def add_triangles(self, triangles: np.ndarray, uv: np.ndarray | None = None) -> None:
        self.triangles.append(triangles)
        self.uv.append(np.zeros((len(triangles), 3, 2)) if uv is None else uv)
        self.index.append(np.full(len(triangles), len(self.materials) - 1))

    def point(self, position: np.ndarray) -> int:
        self.vertices.append(position[None])
        self.count += 1
        return self.count - 1

    def strip(self, loop: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Quads from a loop of the mesh to new points inside of it; the new points' indices."""
        new = self.count + np.arange(len(loop))
        self.vertices.append(inner)
        self.count += len(inner)
        loop_after, new_after = np.roll(loop, -1), np.roll(new, -1)
        self.add_triangles(np.stack([loop, loop_after, new_after], axis=1))
        self.add_triangles(np.stack([loop, new_after, new], axis=1))
        return new

    def result(self) -> HeadMesh:
        added = self.count - len(self.mesh.vertices)
        colors = self.mesh.vertex_colors
        if colors is not None:
            colors = np.concatenate([colors, np.full((added, 3), 0.4, dtype=np.float32)])
        return replace(
            self.mesh,
            vertices=np.concatenate(self.vertices),
            triangles=np.concatenate(self.triangles).astype(np.int32),
            uv=np.concatenate(self.uv).astype(np.float32),
            vertex_colors=colors,
            material_index=np.concatenate(self.index).astype(np.int32),
            materials=tuple(self.materials),
        )

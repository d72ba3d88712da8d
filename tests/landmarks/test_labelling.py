# SPDX-License-Identifier: GPL-3.0-or-later
"""What is told of a head's triangles by names and landmarks."""

from __future__ import annotations

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.landmarks.labelling import labelled, name_label
from generator.landmarks.topology import FACE_MESH


def a_face(step: float = 2.0) -> tuple[HeadMesh, np.ndarray]:
    """A finely cut plane through the mean face, squeezed flat."""
    points = np.array(FACE_MESH.surface_face())
    points[:, 2] *= 0.01
    axis = np.arange(-90, 90, step)
    x, y = np.meshgrid(axis, axis)
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    side = len(axis)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    triangles = np.concatenate(
        [
            np.stack([first, first + 1, first + side + 1], 1),
            np.stack([first, first + side + 1, first + side], 1),
        ]
    ).astype(np.int32)
    index = np.zeros(len(triangles), np.int32)
    return HeadMesh(vertices, triangles, None, None, index, (Material("head"),)), points


def area(mesh: HeadMesh, label: str) -> float:
    """Of the triangles of a class, mm2."""
    mine = np.isin(mesh.material_index, [k for k, m in enumerate(mesh.materials) if m.label == label])
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles[mine]], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_names_of_materials() -> None:
    told = {
        "Hair_cards": "hair", "eyelashes": "brows", "Eyebrow_L": "brows", "eye_left": "eyes",
        "eyelid": "skin", "Teeth": "teeth", "head": "skin", "T-Shirt": "clothes",
        "male_beard": "beard", "cornea": "eyes",
    }  # fmt: skip
    assert {name: name_label(Material(name)) for name in told} == told


def test_areas_lie_where_the_landmarks_are() -> None:
    mesh, points = a_face()
    points[13, 1], points[14, 1] = points[13, 1] + 4, points[14, 1] - 4  # the mouth is open
    told = labelled(mesh, points)
    assert (told.triangles == mesh.triangles).all() and len(told.materials) == 7
    middles = told.vertices[told.triangles].mean(axis=1)
    for label, place in (("eyes", [159, 145]), ("lips", [17]), ("teeth", [13, 14]), ("brows", [52, 105])):
        nearest = np.linalg.norm(middles - points[place].mean(axis=0) * [1, 1, 0], axis=1).argmin()
        found = told.materials[told.material_index[nearest]].label
        assert found == label or (label == "lips" and found == "skin"), label
    # A polygon's area by the shoelace formula, of one eye, against the triangles of both.
    eye = points[[33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246], :2]
    x, y = eye.T
    shoelace = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    assert np.isclose(area(told, "eyes"), 2 * shoelace, rtol=0.15)


def test_a_closed_mouth_has_no_teeth_and_missing_points_no_area() -> None:
    mesh, points = a_face()
    points[13], points[14] = points[14], points[14]
    points[33] = np.nan  # one eye has no outline
    told = labelled(mesh, points)
    assert area(told, "teeth") == 0
    assert 0 < area(told, "eyes") < 0.7 * area(labelled(*a_face()), "eyes")


def test_what_lies_deep_behind_is_not_told() -> None:
    mesh, points = a_face()
    points[:, 2] += 100.0
    assert {m.label for m in labelled(mesh, points).materials} == {"skin"}

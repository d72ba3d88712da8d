# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads as people have them: turned, upside down, in no unit, beside a floor or another head."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from placed_head import PlacedHead

from generator.errors import HeadError
from generator.execution.lanes.renderer import Renderer
from generator.geometry.rotation import geodesic_deg, graphics_rotation, rotation_from_angles
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.placing.placer import Placer

PIVOT_MM, TURN_DEG = 8.0, 5.0
"""How well pivot and turn of an oblique head are found: a face's shape leaves its pitch open by 3 degrees."""


class Places:
    """Places a mesh in frame U, mm, pivot at the origin, that was changed."""

    def __init__(self, placed: PlacedHead, renderer: Renderer, detector: MediaPipeFaceMesh, scratch: Path):
        self.mesh = placed.mesh
        self._head = replace(placed.head, units=None, up=None, forward=None)
        self._parts = renderer, detector, scratch

    def __call__(self, mesh: HeadMesh, frame: str = "source", **head: object) -> Placement:
        read: dict[str, HeadMesh] = {"": mesh}
        placer = Placer(*self._parts, lambda head: read[""])
        wanted: Head = replace(self._head, **head)  # type: ignore[arg-type]
        return placer.subject([wanted], frame).placement

    def turned(self, *angles_deg: float) -> HeadMesh:
        """The mesh after a pose."""
        rotation = graphics_rotation(rotation_from_angles(np.array(angles_deg)))
        return replace(self.mesh, vertices=self.mesh.vertices @ rotation.T)


@pytest.fixture(scope="module")
def place(
    placed_head: PlacedHead,
    renderer: Renderer,
    detector: MediaPipeFaceMesh,
    tmp_path_factory: pytest.TempPathFactory,
) -> Places:
    return Places(placed_head, renderer, detector, tmp_path_factory.mktemp("places"))


@pytest.mark.parametrize(
    "angles",
    [(25, 0, 0), (-45, 0, 0), (0, 0, 40), (35, 30, -20), (20, 160, 10), (-30, -100, 25), (10, 40, 170)],
    ids=str,
)
def test_a_turned_head_is_levelled_about_its_own_middle(place: Places, angles: tuple[float, ...]) -> None:
    mesh = place.turned(*angles)
    began = time.monotonic()
    placement = place(mesh, "canonical")
    assert time.monotonic() - began < 60, "on a busy machine"
    assert np.linalg.norm(np.multiply(placement.pivot, placement.mm_per_unit)) < PIVOT_MM
    back = placement.normalise(mesh).vertices
    centred = place.mesh.vertices
    fit = np.linalg.lstsq(centred, back - np.mean(back - centred, axis=0), rcond=None)[0]
    assert float(geodesic_deg(np.eye(3), fit.T)) < TURN_DEG
    assert any("turned" in note for note in placement.notes)


def test_axes_are_found_bit_for_bit(place: Places) -> None:
    straight = place(place.mesh)
    assert not any("turned" in note for note in straight.notes)
    swapped = replace(place.mesh, vertices=place.mesh.vertices[:, [0, 2, 1]] * [1, -1, 1])
    placement = place(swapped)
    assert (placement.up, placement.forward) == ("+Z", "-Y")
    assert (placement.radius_mm, placement.turned_deg) == (straight.radius_mm, (0.0, 0.0, 0.0))


def test_a_face_on_its_head_is_not_believed(place: Places) -> None:
    """Seen from the front in the likeliest axes, and upside down."""
    mesh = replace(place.mesh, vertices=place.mesh.vertices * [-1, -1, 1])
    placement = place(mesh)
    assert (placement.up, placement.forward) == ("-Y", "+Z")
    with pytest.raises(HeadError, match=r"turned by 1[78]. degrees"):
        place(mesh, up="+Y", forward="+Z")


def test_a_stray_triangle_a_floor_and_a_second_head_are_left_out(place: Places) -> None:
    mesh = place.mesh
    low = mesh.vertices.min(axis=0)
    usual = place(mesh)
    others = {
        "stray": np.array([[1700.0, 0, 0], [1705, 0, 0], [1700, 5, 0]]),
        "floor": np.array([[-900.0, low[1] - 20, -900], [900, low[1] - 20, -900], [0, low[1] - 20, 1800]]),
        "backdrop": np.array([[-900.0, -900, low[2] - 20], [900, -900, low[2] - 20], [0, 900, low[2] - 20]]),
    }
    for name, points in others.items():
        placement = place(_with(mesh, points, np.array([[0, 1, 2]])))
        assert np.linalg.norm(np.subtract(placement.pivot, usual.pivot)) < 1.5, name
        assert abs(placement.radius_mm - usual.radius_mm) < 1.0, name
        assert any(note.startswith("1 of ") and "left out" in note for note in placement.notes), name
    both = _with(mesh, mesh.vertices + np.array([350.0, 0, 0]), mesh.triangles)
    placement = place(both)
    beside = np.array(placement.pivot) - usual.pivot
    assert min(np.linalg.norm(beside), np.linalg.norm(beside - [350.0, 0, 0])) < 3.0
    assert abs(placement.radius_mm - usual.radius_mm) < 2.0
    assert any(note.startswith(f"{len(mesh.triangles)} of ") for note in placement.notes)


def test_a_head_of_no_unit_and_a_wrong_one(place: Places) -> None:
    small = replace(place.mesh, vertices=place.mesh.vertices / 300)
    placement = place(small)
    assert (placement.units, placement.eye_distance_mm) == ("eyes", 90.0)
    assert any("--eye-distance" in note for note in placement.notes)
    assert place(small, eye_distance_mm=80.0).eye_distance_mm == 80.0
    with pytest.raises(HeadError, match=r"in m the outer eye corners are .* mm apart"):
        place(small, units="m")


def test_what_is_no_head_is_refused_in_a_line(place: Places) -> None:
    ball = place.mesh.vertices / np.linalg.norm(place.mesh.vertices, axis=1, keepdims=True) * 100
    plain = replace(place.mesh.materials[0], texture=None)
    materials = tuple(replace(plain, name=m.name) for m in place.mesh.materials)
    began = time.monotonic()
    with pytest.raises(HeadError, match="no face was found from the front or any other side"):
        place(replace(place.mesh, vertices=ball, materials=materials, uv=None))
    assert time.monotonic() - began < 60, "on a busy machine"


def _with(mesh: HeadMesh, points: np.ndarray, triangles: np.ndarray) -> HeadMesh:
    """A mesh with more of it, painted by the first material, or as the mesh itself."""
    twice = len(triangles) == len(mesh.triangles)
    uv = mesh.uv if twice or mesh.uv is None else np.zeros((len(triangles), 3, 2), dtype=np.float32)
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, points]),
        triangles=np.concatenate([mesh.triangles, triangles + len(mesh.vertices)]).astype(np.int32),
        uv=None if mesh.uv is None or uv is None else np.concatenate([mesh.uv, uv]),
        material_index=np.concatenate(
            [mesh.material_index, mesh.material_index if twice else np.zeros(len(triangles), np.int32)]
        ).astype(np.int32),
    )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors on an ellipsoid whose landmarks, silhouettes and hidden sides are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from generator.codec import from_plain, to_plain
from generator.errors import HeadError
from generator.geometry.camera import Camera
from generator.geometry.raycast import first_hits
from generator.geometry.rotation import (
    CAMERA_FROM_GRAPHICS,
    geodesic_deg,
    graphics_rotation,
    rotation_from_angles,
)
from generator.heads.mesh import HeadMesh, Material
from generator.landmarks.anchors import Anchors, no_anchors
from generator.landmarks.surface import TOLERANCE_MM, Surface
from generator.landmarks.topology import FACE_MESH
from generator.placing.anchors import Sighting, find_anchors
from generator.placing.levelling import SHAPE_SD_DEG, level
from generator.plan.settings import Look
from generator.plan.views import Views

RADII = np.array([70.0, 100.0, 80.0])
SIDE = 454
"""The point farthest to the subject's left."""

CAMERA = Camera.square(384, 200.0, 1500.0)
ANGLES = [(0, 0, 0), (10, 0, 0), (-10, 0, 0), (0, 8, 0), (0, -8, 0), (6, 5, 5), (-6, 5, -5)]


def plain(vertices: np.ndarray, triangles: np.ndarray) -> HeadMesh:
    index = np.zeros(len(triangles), np.int32)
    return HeadMesh(vertices, triangles.astype(np.int32), None, None, index, (Material("skin"),))


@pytest.fixture(scope="module")
def ellipsoid() -> HeadMesh:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    return plain(np.array(ball.vertices) * RADII, np.array(ball.faces))


@pytest.fixture(scope="module")
def truth(ellipsoid: HeadMesh) -> np.ndarray:
    """The 468 points of a face on the front of the mesh, frame C."""
    rays = FACE_MESH.surface_face() * [0.8, 0.8, 1.0] + [0, 0, 70.0]  # seen from the middle of the head
    hits = first_hits(np.zeros_like(rays), rays, ellipsoid.vertices, ellipsoid.triangles)
    return hits @ CAMERA_FROM_GRAPHICS


def seen_at(angles: list, camera: Camera) -> Views:
    return Views(tuple(map(tuple, angles)), (camera,), (Look(),))


def views_of(points: np.ndarray, noise_px: float, rng: np.random.Generator) -> list[Sighting]:
    views = []
    for angles in ANGLES:
        rotation = rotation_from_angles(np.array(angles, float))
        pixels = CAMERA.project(points @ rotation.T + CAMERA.translation_mm)
        views.append(Sighting(rotation, pixels + rng.normal(0, noise_px, pixels.shape)))
    return views


def test_first_hits_are_those_of_the_slow_and_simple_way(ellipsoid: HeadMesh) -> None:
    rng = np.random.default_rng(1)
    origins = rng.normal(size=(200, 3)) * 30 + [0, 0, -400]
    directions = rng.normal(size=(200, 3)) * [0.2, 0.2, 0] + [0, 0, 1]
    surface = Surface(ellipsoid)
    hits = surface.first_hits(origins, directions)
    simple = first_hits(origins, directions, surface.vertices, surface.triangles)
    np.testing.assert_array_equal(hits.triangles < 0, np.isnan(simple).any(axis=1))
    assert 20 < (hits.triangles < 0).sum() < 180
    np.testing.assert_allclose(hits.points, simple, atol=1e-3)
    hit = hits.triangles >= 0
    reached = origins + hits.distances[:, None] * directions
    np.testing.assert_allclose(reached[hit], simple[hit], atol=1e-3)
    assert np.isinf(hits.distances[~hit]).all()


def test_anchors_are_exact_without_noise_and_average_it_away(ellipsoid: HeadMesh, truth: np.ndarray) -> None:
    surface = Surface(ellipsoid)
    rng = np.random.default_rng(2)
    clean = find_anchors(surface, views_of(truth, 0.0, rng), CAMERA, FACE_MESH)
    assert (clean.views, clean.off, clean.absent) == (7, 0, 0)
    always = surface.visible(truth, seen_at(ANGLES, CAMERA)).all(axis=0)
    assert always.sum() > 400
    assert np.linalg.norm(clean.points - truth, axis=1)[always].max() < 0.02
    assert clean.residual_px < 0.1
    np.testing.assert_allclose(surface.points(clean.triangles, clean.weights), clean.points)

    noisy = find_anchors(surface, views_of(truth, 1.0, rng), CAMERA, FACE_MESH)
    mm_per_px = CAMERA.view_mm / CAMERA.width
    sideways = (noisy.points - truth)[:, :2] / mm_per_px
    assert np.sqrt((sideways**2).mean()) < 0.6, "seven views: 1 / sqrt(7) = 0.38 px, and a robust mean"
    assert noisy.residual_px == pytest.approx(np.sqrt(2), rel=0.15)


def test_points_beside_the_silhouette_are_counted_and_too_far_ones_absent(
    ellipsoid: HeadMesh, truth: np.ndarray
) -> None:
    views = views_of(truth, 0.0, np.random.default_rng(3))
    for view in views:
        view.pixels[SIDE] = [384 / 2 + 75 / CAMERA.view_mm * 384, 384 / 2]  # 5 mm beside the ellipsoid
        view.pixels[6] = [384 / 2 + 110 / CAMERA.view_mm * 384, 384 / 2]  # 40 mm
    anchors = find_anchors(Surface(ellipsoid), views, CAMERA, FACE_MESH)
    assert (anchors.off, anchors.absent) == (1, 1)
    assert abs(anchors.points[SIDE, 0] - 70) < 2
    assert np.isnan(anchors.points[6]).all()
    assert anchors.triangles[6] == -1
    assert anchors.problems == ["1 landmarks have no place on the mesh: NaN"]
    assert no_anchors(FACE_MESH).problems == ["no face was found near the front: landmarks_exact is NaN"]
    back = from_plain(Anchors, to_plain(anchors))
    np.testing.assert_array_equal(back.points, anchors.points)
    np.testing.assert_array_equal(back.triangles, anchors.triangles)
    # Hair: a large triangle behind the face, which is what a ray meets that passes the jaw.
    count = len(ellipsoid.vertices)
    wall = plain(
        np.concatenate([ellipsoid.vertices, [[60, -90, -60], [300, 0, -60], [60, 90, -60]]]),
        np.concatenate([ellipsoid.triangles, [[count, count + 1, count + 2]]]),
    )
    views = views_of(truth, 0.0, np.random.default_rng(3))
    for view in views:
        view.pixels[SIDE] = CAMERA.project(view.rotation @ [85.0, 0.0, 60.0] + CAMERA.translation_mm)
    behind = find_anchors(Surface(wall), views, CAMERA, FACE_MESH)
    assert (behind.off, behind.absent) == (1, 0)
    assert np.linalg.norm(behind.points[SIDE] - truth[SIDE]) < 20, "back on the face, and counted"
    np.testing.assert_array_equal(back.weights, anchors.weights)


def test_visible_is_what_faces_the_camera_on_a_convex_body(ellipsoid: HeadMesh, truth: np.ndarray) -> None:
    surface = Surface(ellipsoid)
    angles = np.random.default_rng(4).uniform(-180, 180, (40, 3))
    rotations = rotation_from_angles(angles)
    for camera in (CAMERA, Camera.square(128, 35.0, 500.0), replace(CAMERA, projection="orthographic")):
        visible = surface.visible(truth, seen_at(angles.tolist(), camera))
        posed = truth @ np.swapaxes(rotations, 1, 2) + camera.translation_mm
        normals = (truth / (RADII**2)) @ np.swapaxes(rotations, 1, 2)
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        rays = posed if camera.projection == "perspective" else np.array([0.0, 0.0, 1.0])
        facing = (normals * (rays / np.linalg.norm(rays, axis=-1, keepdims=True))).sum(2)
        sure = np.abs(facing) > 0.05  # the mesh's facets lean up to 2 degrees from the ellipsoid
        np.testing.assert_array_equal(visible[sure], facing[sure] < 0)
        assert 0.3 < visible.mean() < 0.7


def test_outside_the_image_nothing_is_visible(ellipsoid: HeadMesh, truth: np.ndarray) -> None:
    near = Camera.square(128, 200.0, 500.0)
    visible = Surface(ellipsoid).visible(truth, seen_at([(0, 0, 0)], near))[0]
    pixels = near.project(truth + near.translation_mm)
    inside = ((pixels >= 0) & (pixels <= 128)).all(axis=1)
    assert not visible[~inside].any()
    assert 0 < visible.sum() < 468
    assert not Surface(ellipsoid).visible(np.full((468, 3), np.nan), seen_at([(0, 0, 0)], near)).any()


def test_rays_go_through_holes(tmp_path: Path) -> None:
    """A curtain whose left half is cut out hangs 20 mm before a wall."""
    alpha = np.full((8, 8, 4), 255, np.uint8)
    alpha[:, :4, 3] = 0
    cv2.imwrite(str(tmp_path / "t.png"), alpha)
    square = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], float)
    order = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)[order]
    mesh = HeadMesh(
        np.concatenate([square, square + np.array([0, 0, 20])]),
        np.concatenate([order, order + 4]),
        np.concatenate([uv, uv]),
        None,
        np.array([0, 0, 1, 1], np.int32),
        (Material("wall"), Material("curtain", texture=tmp_path / "t.png", cutout=True)),
    )
    surface = Surface(mesh)
    wall = np.array([[-25.0, 5, 0], [25.0, 5, 0]])
    assert surface.visible(wall, seen_at([(0, 0, 0)], CAMERA)).tolist() == [[True, False]]
    hits = surface.first_hits(np.array([[-25.0, 5, -400], [25.0, 5, -400]]), np.tile([0, 0, 1.0], (2, 1)))
    np.testing.assert_allclose(hits.points[:, 2], [0, -20], atol=1e-4)
    assert TOLERANCE_MM < 1
    (tmp_path / "t.png").write_bytes(b"no picture")
    with pytest.raises(HeadError, match=r"t\.png is not an image"):
        Surface(mesh)


@pytest.mark.parametrize(("wrap", "holes"), [("extend", "x..."), ("repeat", "x.x."), ("mirror", "x..x")])
def test_holes_lie_where_the_renderer_draws_them(tmp_path: Path, wrap: str, holes: str) -> None:
    """The left half of a texture is cut out; it goes on over twice its width."""
    alpha = np.full((8, 8, 4), 255, np.uint8)
    alpha[:, :4, 3] = 0
    cv2.imwrite(str(tmp_path / "t.png"), alpha)
    square = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], float)
    order = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], np.float32)[order]
    material = Material("lashes", texture=tmp_path / "t.png", cutout=True, wrap=wrap)
    surface = Surface(HeadMesh(square, order, uv, None, np.zeros(2, np.int32), (material,)))
    origins = np.array([[x, 5.0, -400] for x in (-40, -15, 10, 35)])
    found = surface.first_hits(origins, np.tile([0, 0, 1.0], (4, 1)))
    assert "".join("x" if triangle < 0 else "." for triangle in found.triangles) == holes


def sighting(pose_deg: Sequence[float], leaning: np.ndarray) -> Sighting:
    """What a detector that finds the mean face says of a head at a pose, whose face leans in its own axes."""
    rotation = rotation_from_angles(np.array(pose_deg, dtype=float))
    level = rotation_from_angles(np.array([0.0, -FACE_MESH.level_pitch_deg, 0.0]))  # as its own model face is
    face = FACE_MESH.reference_face() @ CAMERA_FROM_GRAPHICS @ level.T
    return Sighting(rotation, 1.3 * face @ (rotation @ leaning).T + [200.0, 190.0, -3.0])


def test_levelling_undoes_a_leaning_face() -> None:
    leaning = rotation_from_angles(np.array([2.0, -8.0, 1.0]))
    # A turn about the pose's own axes is a turn of the head: which pose it was seen at does not matter.
    same = [sighting(pose, leaning) for pose in ((0, 0, 0), (10, 0, 0), (0, 8, 0), (-6, 5, -5))]
    levelling = level(same, FACE_MESH)
    assert levelling is not None
    assert geodesic_deg(graphics_rotation(levelling.correction), leaning.T) < 1e-4
    np.testing.assert_allclose(levelling.sd_deg, SHAPE_SD_DEG, atol=1e-4)
    lifted = [sighting((0, 0, 0), leaning @ rotation_from_angles(np.array([0.0, up, 0.0]))) for up in (0, 4)]
    shaky = level(lifted, FACE_MESH)
    assert shaky is not None
    assert shaky.sd_deg[1] > levelling.sd_deg[1] + 0.1
    assert level([], FACE_MESH) is None


def test_the_surface_face_is_symmetric() -> None:
    face = FACE_MESH.surface_face()
    pairs = FACE_MESH.mirror_pairs()
    np.testing.assert_allclose(face[pairs] * [-1, 1, 1], face, atol=0.011)
    assert np.abs(face.mean(axis=0)).max() < 0.01


def test_points_beside_the_surface_are_counted(ellipsoid: HeadMesh, truth: np.ndarray) -> None:
    surface = Surface(ellipsoid)
    points = truth.copy()
    points[5] = np.nan
    assert surface.off(points) == 0
    points[:7] *= 1 + 1e-2
    assert surface.off(points) == 6, "NaN is no place beside the surface"
    assert surface.off(truth @ rotation_from_angles(np.array([20.0, 0, 0])).T) > 400


def test_a_point_on_an_open_edge_is_on_the_surface() -> None:
    corner = np.array([[0.0, 0, 0], [30, 0, 0], [0, 30, 0]])
    surface = Surface(plain(corner, np.array([[0, 1, 2]])))
    edge = surface.points(np.zeros(3, int), np.array([[1.0, 0, 0], [0.5, 0.5, 0], [0, 0.3, 0.7]]))
    assert surface.off(edge) == 0
    assert surface.off(edge + np.array([0, 0, 1.0])) == 3

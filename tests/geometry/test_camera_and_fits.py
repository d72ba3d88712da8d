# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera, ray casts and rigid fits against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from generator.geometry.camera import Camera, Projection, framing_distance, isotropic_pixels
from generator.geometry.raycast import first_hits
from generator.geometry.rigid import fit_rotations, fit_similarity
from generator.geometry.rotation import rotation_from_angles


def test_rays_invert_projection() -> None:
    camera = Camera.square(256, 85.0, 700.0)
    points = np.random.default_rng(0).uniform(-80, 80, (50, 3)) + camera.translation_mm
    origins, rays = camera.rays(camera.project(points))
    assert not origins.any()
    assert np.allclose(rays * points[:, 2:], points)


def test_orthographic_rays_are_parallel_and_agree_with_perspective_at_the_pivot() -> None:
    flat, deep = Camera.square(256, 85.0, 700.0, "orthographic"), Camera.square(256, 85.0, 700.0)
    points = np.random.default_rng(0).uniform(-80, 80, (50, 3)) + flat.translation_mm
    origins, rays = flat.rays(flat.project(points))
    assert np.allclose(rays, [0, 0, 1])
    assert np.allclose(origins + rays * points[:, 2:], points)
    points[:, 2] = 700.0
    assert np.allclose(flat.project(points), deep.project(points))
    assert np.allclose(flat.project([flat.view_mm / 2, 0, 123.0]), [256, 128])
    for camera in (flat, deep):
        moved = points + np.array([0, 0, 5.0])
        ours = isotropic_pixels(
            moved[None], camera.matrix[None], camera.translation_mm[None], [camera.projection]
        )
        assert np.allclose(ours[0, :, :2], camera.project(moved))


def test_the_pivot_is_the_centre_of_the_image() -> None:
    camera = Camera.square(200, 50.0, 400.0)
    assert np.allclose(camera.project(camera.translation_mm), [100, 100])


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("lens", [20.0, 85.0, 135.0])
def test_a_framed_sphere_stays_inside(lens: float, projection: Projection) -> None:
    radius, directions = 140.0, np.random.default_rng(1).normal(size=(20_000, 3))
    sphere = radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    camera = Camera.square(256, lens, framing_distance(radius, lens, 1.0, projection), projection)
    pixels = camera.project(sphere + camera.translation_mm)
    assert pixels.min() > 0
    assert pixels.max() < 256
    assert pixels.max() > 250, "and it fills the image"


def test_framing_rejects_nonsense() -> None:
    with pytest.raises(ValueError, match="positive"):
        framing_distance(-1, 85, 1)


def test_first_hits_of_a_cube() -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (2, 4)], dtype=float)
    quads = [(0, 2, 6, 4), (1, 3, 7, 5), (0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    directions = np.array([[0.1, 0.2, 1.0], [0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    hits = first_hits(np.zeros((4, 3)), directions, corners, triangles)
    assert np.allclose(hits[0], [0.2, 0.4, 2.0])
    assert np.allclose(hits[1], [0, 0, 2])
    assert np.isnan(hits[2:]).all()


def test_fit_recovers_a_similarity() -> None:
    rng = np.random.default_rng(2)
    source = rng.normal(size=(468, 3))
    rotation = rotation_from_angles(np.array([33, -21, 170]))
    fit = fit_similarity(source, 2.5 * source @ rotation.T + [1, 2, 3])
    assert fit.scale == pytest.approx(2.5)
    assert np.allclose(fit.rotation, rotation)
    assert np.allclose(fit.translation, [1, 2, 3])
    assert fit.rms < 1e-12


def test_fit_never_mirrors() -> None:
    source = np.random.default_rng(3).normal(size=(20, 3))
    assert np.linalg.det(fit_similarity(source, source * [1, 1, -1]).rotation) == pytest.approx(1)


@pytest.mark.parametrize(
    ("source", "target"),
    [(np.zeros((5, 3)), np.ones((5, 3))), (np.full((4, 3), np.nan), np.ones((4, 3))), (np.ones((2, 3)),) * 2],
)
def test_fit_rejects_nonsense(source: np.ndarray, target: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"fit|expected"):
        fit_similarity(source, target)


def test_many_rotations_at_once_are_those_of_one_fit_each() -> None:
    rng = np.random.default_rng(8)
    source = rng.normal(size=(30, 3))
    rotations = rotation_from_angles(rng.uniform(-180, 180, (20, 3)))
    targets = 2.5 * source @ np.swapaxes(rotations, 1, 2) + rng.normal(size=(20, 1, 3))
    assert np.allclose(fit_rotations(source, targets), rotations)
    noisy = targets + rng.normal(0, 0.5, targets.shape)
    one_by_one = np.stack([fit_similarity(source, target).rotation for target in noisy])
    assert np.allclose(fit_rotations(source, noisy), one_by_one)

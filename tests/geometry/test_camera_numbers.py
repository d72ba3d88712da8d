# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras, fits and ray casts to the number, where closed forms give it."""

from __future__ import annotations

import dataclasses
import math
from itertools import product

import numpy as np
import pytest

from generator.geometry.camera import (
    SENSOR_MM,
    Camera,
    Projection,
    framed_margin,
    framing_distance,
    framing_lens,
    isotropic_pixels,
)
from generator.geometry.raycast import first_hits
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import angles_from_rotation, rotation_from_angles

PROJECTIONS: tuple[Projection, ...] = ("perspective", "orthographic")


def test_k_is_the_documented_matrix() -> None:
    camera = Camera.square(256, 85.0, 700.0)
    focal = 256 * 85 / 36
    np.testing.assert_allclose(camera.matrix, [[focal, 0, 128], [0, focal, 128], [0, 0, 1]], rtol=1e-15)
    aside = dataclasses.replace(camera, principal_px=(100.0, 140.0))
    np.testing.assert_allclose(aside.matrix[:2, 2], [100, 140])
    np.testing.assert_allclose(camera.translation_mm, [0, 0, 700])


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_lens_distance_and_margin_are_each_other_s_inverses(projection: Projection) -> None:
    for lens, margin in product((20.0, 85.0), (1.0, 1.2)):
        distance = framing_distance(110.0, lens, margin, projection)
        assert framing_lens(110.0, distance, margin, projection) == pytest.approx(lens)
        assert framed_margin(110.0, lens, distance, projection) == pytest.approx(margin)
    half = math.atan(SENSOR_MM / 2 / 50.0)
    reach = math.sin(half) if projection == "perspective" else math.tan(half)
    assert framing_distance(100.0, 50.0, 1.1, projection) == pytest.approx(110 / reach)


@pytest.mark.parametrize("numbers", [(0, 85, 1), (-1, 85, 1), (140, 0, 1), (140, 85, 0)])
def test_a_camera_of_no_size_is_refused(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        framing_distance(*numbers)
    assert framing_distance(0.5, 0.5, 0.5) > 0


@pytest.mark.parametrize("distance", [110.0, 60.0])
def test_a_camera_within_a_head_is_refused(distance: float) -> None:
    with pytest.raises(ValueError, match="stands inside a head of 110 mm"):
        framing_lens(100.0, distance, 1.1)
    assert framing_lens(100.0, 110.1, 1.1) > 0


def test_what_lies_on_the_border_is_held() -> None:
    camera = Camera.square(200, 50.0, 400.0)
    pixels = np.array([[0, 0], [200, 200], [200.1, 5], [5, -0.1]])
    assert camera.holds(pixels).tolist() == [True, True, False, False]


def test_isotropic_pixels_to_the_number() -> None:
    """One point 30 mm beside, 20 below and 50 behind the pivot, by each projection, with two focals."""
    point = np.array([30.0, 20.0, 450.0])
    k = np.array([[800.0, 0, 100], [0, 600, 90], [0, 0, 1]])
    rows = isotropic_pixels(
        np.stack([point[None]] * 2), np.stack([k] * 2), np.array([[0, 0, 400.0]] * 2), PROJECTIONS
    )
    behind = 50 * 800 / 400
    perspective = [100 + 800 * 30 / 450, 90 + 600 * 20 / 450, behind]
    np.testing.assert_allclose(rows[0, 0], perspective)
    np.testing.assert_allclose(rows[1, 0], [100 + 800 * 30 / 400, 90 + 600 * 20 / 400, behind])


def test_the_nearest_triangle_before_the_origin_is_hit_at_its_border_too() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    vertices = np.concatenate([corners + np.array([0, 0, z]) for z in (0.5, 3.0, -0.5)])
    triangles = np.arange(9).reshape(3, 3)
    at = [[0.2, 0.2], [0, 0], [1, 0], [0.5, 0.5], [0.51, 0.51], [-0.01, 0.2]]
    origins = np.array([[x, y, 0.0] for x, y in at])
    hits = first_hits(origins, np.tile([0.0, 0, 1], (len(at), 1)), vertices, triangles)
    np.testing.assert_allclose(hits[:4], np.column_stack([at[:4], np.full(4, 0.5)]))
    assert np.isnan(hits[4:]).all()
    # A ray that lies in the plane of a triangle meets none.
    assert np.isnan(
        first_hits(np.array([[-1.0, 0.2, 0.5]]), np.array([[1.0, 0, 0]]), vertices, triangles)
    ).all()


def test_three_points_are_enough_and_a_mirrored_set_has_the_nearest_rotation() -> None:
    three = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    fit = fit_similarity(three, 3 * three + [1, 2, 3])
    assert fit.scale == pytest.approx(3) and fit.rms < 1e-12
    np.testing.assert_allclose(fit.rotation, np.eye(3), atol=1e-12)
    corners = np.array(list(product((-1.0, 1.0), (-2.0, 2.0), (-3.0, 3.0))))
    mirrored = fit_similarity(corners, corners * [-1, 1, 1])
    # The axis with the smallest extent is given up: trace of the two others over all, Umeyama's Eq. 42.
    np.testing.assert_allclose(mirrored.rotation, np.eye(3), atol=1e-12)
    assert mirrored.scale == pytest.approx((4 + 9 - 1) / 14)
    assert mirrored.rms == pytest.approx(math.sqrt(14 - 14 * mirrored.scale**2))
    for source, target in ((three[:2], three[:2]), (three, three[:2]), (three[:, :2], three[:, :2])):
        with pytest.raises(ValueError, match="expected two point sets of equal shape"):
            fit_similarity(source, target)
    with pytest.raises(ValueError, match="all coincide"):
        fit_similarity(three, np.ones((3, 3)))


@pytest.mark.parametrize("yaw", [90.0, -90.0])
def test_rounding_beyond_a_right_angle_is_a_right_angle(yaw: float) -> None:
    turned = rotation_from_angles(np.array([yaw, 0, 0]))
    turned[0, 2] *= 1 + 1e-12
    assert angles_from_rotation(turned)[0] == pytest.approx(yaw)

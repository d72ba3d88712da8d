# SPDX-License-Identifier: GPL-3.0-or-later
"""What is behind the head, and how the two are mixed."""

from __future__ import annotations

import numpy as np
import pytest

from generator.geometry.camera import Camera
from generator.picture.backdrop import before, filling, noise, seen_panorama
from generator.picture.develop import to_bytes, to_linear
from generator.picture.irradiance import directions

CAMERA = Camera(96, 64, 24.0, 700.0, principal_px=(50.0, 30.0))


@pytest.mark.parametrize("turn", [0.0, 30.0, 175.0, -90.0])
def test_each_pixel_sees_where_its_ray_points(turn: float) -> None:
    """A panorama whose colours are its directions, far away."""
    vectors, _ = directions(256, 512)
    seen = seen_panorama((vectors + 2).astype(np.float32), CAMERA, turn) - 2
    x, y = np.meshgrid(np.arange(96) + 0.5, np.arange(64) + 0.5)
    _, rays = CAMERA.rays(np.stack([x, y], axis=-1))
    right, down, into = np.moveaxis(rays / np.linalg.norm(rays, axis=-1, keepdims=True), -1, 0)
    c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
    # As the panorama before its turn sees them; see irradiance.turned.
    expected = np.stack([c * right - s * into, s * right + c * into, -down], axis=-1)
    np.testing.assert_allclose(seen, expected, atol=2e-3)


def test_only_what_is_seen_is_looked_at_and_a_sun_is_cut_off_before_it_is_enlarged() -> None:
    light = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)
    light[32, 0] = 1000
    for lens, turn in ((24.0, 0.0), (24.0, 180.0), (200.0, 178.6), (12.0, 90.0)):
        camera = Camera.square(48, lens, 700.0)
        whole = seen_panorama(np.minimum(light * np.float32(0.5), 1), camera, turn)
        np.testing.assert_allclose(seen_panorama(light, camera, turn, 0.5, 1.0), whole, atol=1e-6)
        assert whole.max() < 1.2
    seam = seen_panorama(light, Camera.square(48, 200.0, 700.0), 180.0, 0.5, 1.0)
    assert np.abs(np.diff(seam, axis=1)).max() < 0.3, "the seam is none"


def test_noise_is_its_seed_s() -> None:
    one = noise(CAMERA, 5)
    assert one.shape == (64, 96, 3) and one.dtype == np.float32
    np.testing.assert_array_equal(one, noise(CAMERA, 5))
    assert np.abs(one - noise(CAMERA, 6)).mean() > 0.02
    # Smooth: neighbours differ far less than pixels do.
    assert np.abs(np.diff(one, axis=1)).mean() < 0.2 * one.std()


def test_a_picture_fills_the_image_and_keeps_its_middle() -> None:
    wide = np.zeros((100, 400, 3), np.uint8)
    wide[:, 200:] = 255
    seen = filling(wide, CAMERA)
    assert seen.shape == (64, 96, 3)
    assert (seen[:, :46] == 0).all() and (seen[:, 50:] > 0.999).all()
    tall = filling(np.ascontiguousarray(wide.transpose(1, 0, 2)), CAMERA)
    assert (tall[:30] == 0).all() and (tall[34:] > 0.999).all()


def test_a_pixel_that_is_half_head_is_half_backdrop_in_linear_light() -> None:
    head = np.zeros((1, 3, 4), np.float32)
    head[0, 0] = [0.8, 0.4, 0.2, 1.0]
    head[0, 1] = [0.4, 0.2, 0.1, 0.5]
    shown = before(head, np.full((1, 3, 3), 0.5, np.float32))[0]
    np.testing.assert_allclose(shown, [[0.8, 0.4, 0.2], [0.65, 0.45, 0.35], [0.5] * 3], atol=5e-3)


def test_bytes_survive_the_way_through_light() -> None:
    every = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    light = before(np.zeros((16, 16, 4), np.float32), to_linear(every))
    np.testing.assert_array_equal(to_bytes(light), every)

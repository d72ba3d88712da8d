# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera does to an image, step by step against its formula."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from generator.picture.develop import (
    GREY,
    developed,
    disc,
    noise_sd,
    normal,
    softened,
    streak,
    to_srgb,
    toned,
)
from generator.plan.settings import Look

RAMP = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 64, axis=0).repeat(3, axis=2)
"""Every grey there is."""


def seen(image: np.ndarray, seed: int = 1, **sensor: Any) -> np.ndarray:
    return developed(image, Look(**sensor), seed)


def linear(image: np.ndarray) -> np.ndarray:
    x = image / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def test_without_settings_it_is_the_very_image() -> None:
    assert seen(RAMP) is RAMP
    barely = seen(RAMP, exposure_ev=1e-9)
    np.testing.assert_array_equal(barely, RAMP)


def test_a_stop_is_twice_the_light() -> None:
    lighter = linear(seen(RAMP, exposure_ev=1.0))
    inside = linear(RAMP) < 0.48
    np.testing.assert_allclose(lighter[inside], 2 * linear(RAMP)[inside], atol=0.005)
    assert (seen(RAMP, exposure_ev=1.0)[linear(RAMP) > 0.51] == 255).all(), "clipped"


def test_warmth_is_stops_of_red_against_blue() -> None:
    grey = np.full((4, 4, 3), 120, np.uint8)
    red, green, blue = linear(seen(grey, warmth=1.0))[0, 0]
    assert abs(np.log2(red / blue) - 1) < 0.03
    assert abs(green - linear(grey)[0, 0, 1]) < 1e-6


@pytest.mark.parametrize("radius", [0.7, 3.0, 7.5])
def test_defocus_makes_discs_of_points_and_keeps_their_light(radius: float) -> None:
    kernel = disc(radius)
    assert abs(kernel.sum() - 1) < 1e-6
    inside = kernel > 0.5 * kernel.max()
    assert abs(inside.sum() - np.pi * radius**2) < 0.35 * np.pi * radius**2 + 1
    point = np.zeros((41, 41, 3), np.uint8)
    point[20, 20] = 255
    light = linear(seen(point, defocus_px=radius))
    assert abs(light[..., 0].sum() - 1) < 0.25, "but for what eight bits cannot show"


@pytest.mark.parametrize(("angle", "axis"), [(0.0, 1), (90.0, 0)])
def test_motion_draws_a_streak(angle: float, axis: int) -> None:
    kernel = streak(8.0, angle)
    assert abs(kernel.sum() - 1) < 1e-6
    spread = kernel.sum(axis=1 - axis)
    assert 8 <= (spread > 0.02).sum() <= 10
    assert (kernel.sum(axis=axis) > 1e-6).sum() <= 1, "one pixel wide"


def test_motion_upwards_to_the_right() -> None:
    kernel = streak(9.0, 45.0)
    height, width = kernel.shape
    assert kernel[height // 4, 3 * width // 4] > 0.02 > kernel[height // 4, width // 4]


def test_noise_has_the_variance_of_its_model() -> None:
    for level in (30, 118, 200):
        flat = np.full((256, 256, 3), level, np.uint8)
        light = linear(seen(flat, noise=0.02))
        expected = float(noise_sd(linear(flat)[:1, :1, 0], 0.02)[0, 0])
        if level == 30:  # where noise is clipped at black
            expected *= 0.8
        assert abs(light.std() / expected - 1) < 0.12, level
        assert abs(light.mean() - linear(flat).mean()) < 0.002
    assert abs(float(noise_sd(np.array([GREY]), 0.02)[0]) - 0.02) < 1e-9


def test_noise_is_the_same_for_the_same_seed_alone() -> None:
    np.testing.assert_array_equal(seen(RAMP, noise=0.05), seen(RAMP, noise=0.05))
    assert (seen(RAMP, noise=0.05, seed=2) != seen(RAMP, noise=0.05)).mean() > 0.5


def test_the_tone_curve_is_monotone_and_keeps_black_grey_and_white() -> None:
    x = np.linspace(0, 1, 501)
    for contrast in (-1.0, 0.5, 1.0):
        curve = toned(x, contrast)
        assert (np.diff(curve) >= -1e-9).all()
        np.testing.assert_allclose(curve[[0, 250, 500]], [0, 0.5, 1], atol=1e-6)
    assert np.diff(toned(x, 1.0))[250] > np.diff(x)[250]
    np.testing.assert_array_equal(
        seen(RAMP, contrast=0.6), np.rint(toned(to_srgb(linear(RAMP)), 0.6) * 255).astype(np.uint8)
    )


def test_detail_takes_what_is_fine_and_leaves_what_is_coarse() -> None:
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[:, ::2] = 255
    assert linear(seen(stripes, detail=0.25)).std() < 0.05
    halves = np.zeros((64, 64, 3), np.uint8)
    halves[:, 32:] = 255
    assert linear(seen(halves, detail=0.25)).std() > 0.4


def test_softened_coverage_has_edges_of_two_pixels() -> None:
    edge = np.zeros((4, 6), np.float16)
    edge[:, 3:] = 1
    assert softened(edge).tolist() == [[0, 0, 0.25, 0.75, 1, 1]] * 4
    assert softened(edge.T).tolist() == softened(edge).T.tolist()


def test_jpeg_is_what_the_encoder_makes_of_it() -> None:
    rng = np.random.default_rng(0)
    picture = cv2.resize(rng.integers(0, 256, (8, 8, 3), dtype=np.uint8), (64, 64))
    low, high = (np.abs(seen(picture, jpeg=q).astype(int) - picture).mean() for q in (5, 95))
    assert low > 3 * high > 0
    np.testing.assert_array_equal(seen(picture, jpeg=5), seen(picture, jpeg=5))


def test_grain_is_normal_and_its_own_for_every_seed() -> None:
    some, other = normal((256, 256, 3), 5), normal((256, 256, 3), 6)
    assert np.array_equal(some, normal((256, 256, 3), 5 + (1 << 31) * 3)), "of a seed of any size"
    assert abs(np.corrcoef(some.ravel(), other.ravel())[0, 1]) < 0.01
    for reach, share in ((1.0, 0.6827), (2.0, 0.9545), (3.0, 0.9973)):
        assert (np.abs(some) < reach).mean() == pytest.approx(share, abs=0.003)


def test_light_comes_before_noise_and_noise_before_the_tone_curve() -> None:
    flat = np.full((200, 200, 3), 118, np.uint8)
    dark = linear(seen(flat, exposure_ev=-2.0, noise=0.02)).std()
    assert dark < linear(seen(flat, noise=0.02)).std(), "less light, less shot noise"
    grain = normal(flat.shape, 1)
    light = linear(flat).astype(np.float32)
    expected = toned(to_srgb(light + noise_sd(light, 0.02) * grain), 0.5)
    np.testing.assert_allclose(seen(flat, noise=0.02, contrast=0.5) / 255, expected, atol=0.0021)

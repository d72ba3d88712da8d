# SPDX-License-Identifier: GPL-3.0-or-later
"""The quadratic form of irradiance against the integral that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from panoramas import SMALL, even, from_the_right

from generator.picture.files import PANORAMAS, named_files, packaged_panoramas, read_panorama
from generator.picture.irradiance import (
    LUMINANCE,
    Irradiance,
    directions,
    irradiance,
    irradiance_form,
    terms,
)


def normals(count: int = 300) -> np.ndarray:
    found = np.random.default_rng(3).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def integral(panorama: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    """What white surfaces send back: 1/pi of the integral of light times the cosine, pixel by pixel."""
    vectors, solid = directions(*panorama.shape[:2])
    cosines = np.maximum(surfaces @ vectors.reshape(-1, 3).T, 0)
    return cosines @ (panorama * solid[..., None]).reshape(-1, 3) / np.pi


def lit(form: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    """What a form alone gives."""
    return Irradiance(form, np.array([0.0, 1.0, 0.0]), np.zeros(3)).lit(surfaces)


def test_the_pixels_of_a_panorama_cover_the_sphere_once() -> None:
    vectors, solid = directions(*SMALL)
    assert solid.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=-1), 1)
    middle = vectors[15:17, 31:33].mean(axis=(0, 1))
    np.testing.assert_allclose(middle / np.linalg.norm(middle), [0, 1, 0], atol=1e-9)
    assert vectors[16, 48, 0] > 0.99 and vectors[0, 0, 2] > 0.99


def test_even_light_shows_a_white_surface_white() -> None:
    shown = lit(irradiance_form(even(0.7)), normals())
    np.testing.assert_allclose(shown, 0.7, rtol=2e-3)
    found = irradiance(even(0.7))
    np.testing.assert_allclose(found.facing, 0.7, rtol=2e-3)
    assert not found.sun.any()


def test_a_gradient_is_exact() -> None:
    """Light 1 + a . d has degree 1: its irradiance is pi + 2 pi / 3 a . n."""
    vectors, _ = directions(128, 256)
    slope = np.array([0.3, -0.2, 0.5])
    shown = lit(irradiance_form((1 + vectors @ slope)[..., None] * np.ones(3)), normals())
    np.testing.assert_allclose(shown[:, 0], 1 + 2 / 3 * normals() @ slope, atol=2e-4)


def test_light_of_degree_two_is_exact() -> None:
    vectors, _ = directions(128, 256)
    light = 1 + vectors[..., 0] * vectors[..., 2] + 0.5 * (vectors[..., 1] ** 2 - 1 / 3)
    n = normals()
    shown = lit(irradiance_form(light[..., None] * np.ones(3)), n)
    np.testing.assert_allclose(
        shown[:, 1], 1 + (n[:, 0] * n[:, 2] + 0.5 * (n[:, 1] ** 2 - 1 / 3)) / 4, atol=2e-4
    )


def test_one_bright_pixel_is_the_paper_s_approximation_of_the_cosine() -> None:
    """The clamped cosine up to degree 2 is 1/4 + t/2 + 5/32 (3 t^2 - 1), at most 0.1 off (of a peak of 1)."""
    light = np.zeros((*SMALL, 3), np.float32)
    light[10, 20] = 1
    vectors, solid = directions(*SMALL)
    t = normals() @ vectors[10, 20]
    shown = lit(irradiance_form(light), normals())[:, 0] * np.pi / solid[10, 20]
    np.testing.assert_allclose(shown, np.maximum(0.25 + t / 2 + 5 / 32 * (3 * t**2 - 1), 0), atol=1e-6)
    exact = integral(light, normals())[:, 0] * np.pi / solid[10, 20]
    assert np.abs(shown - exact).max() < 0.1


@pytest.mark.parametrize("turn", [-120.0, 0.0, 35.0, 90.0])
def test_a_turned_form_is_the_form_of_the_turned_panorama(turn: float) -> None:
    light = np.random.default_rng(1).uniform(0, 1, (36, 72, 3))
    light[12, 20] = 300
    # Above zero the middle moves to image right, which is to higher columns.
    rolled = irradiance(np.roll(light, round(turn / 5), axis=1))
    found = irradiance(light).turned(turn)
    np.testing.assert_allclose(found.form, rolled.form, atol=1e-12)
    np.testing.assert_allclose(found.direction, rolled.direction, atol=1e-12)
    np.testing.assert_allclose(found.sun, rolled.sun)
    assert found.sun.min() > 0.5 and found.direction @ [0, 0, 1] > 0


def test_terms_say_the_same_as_the_form() -> None:
    form = irradiance(from_the_right()).turned(20).form
    x, y, z = n = normals().T
    values = np.stack([np.ones_like(x), *n, x * y, y * z, z * x, x * x, y * y])
    np.testing.assert_allclose(np.maximum(values.T @ terms(form), 0), lit(form, n.T), atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 60.0, -75.0, 90.0])
def test_the_colour_of_a_ball_is_the_mean_of_its_pixels(turn: float) -> None:
    found = irradiance(from_the_right()).turned(turn)
    x, z = np.meshgrid(np.linspace(-1, 1, 401), np.linspace(-1, 1, 401))
    inside = x**2 + z**2 < 1
    ball = np.stack([x, -np.sqrt(np.maximum(1 - x**2 - z**2, 0)), z], axis=-1)[inside]
    np.testing.assert_allclose(found.facing, found.lit(ball, -np.inf).mean(axis=0), rtol=3e-3)


def test_a_sun_is_apart_and_nothing_is_lost() -> None:
    """A lamp of a few degrees: the very integral but for what little is left for the form."""
    light = even(0.05)
    light[15:17, 47:49] = 400
    found = irradiance(light)
    np.testing.assert_allclose(found.direction, [1, 0, 0], atol=0.01)
    exact = integral(light, normals())
    assert np.abs(found.lit(normals()) - exact).max() < 0.03 * exact.max()
    assert np.abs(lit(irradiance_form(light), normals()) - exact).max() > 0.06 * exact.max()


@pytest.mark.slow
def test_blender_s_panoramas_light_as_they_should() -> None:
    """Against the integral, over all normals, in shares of the mean: sun and lamps included."""
    for name, path in named_files(packaged_panoramas(), PANORAMAS, "test").items():
        light = read_panorama(path)[::4, ::4]
        exact = integral(light, normals(100)) @ LUMINANCE
        error = irradiance(light).lit(normals(100)) @ LUMINANCE - exact
        assert np.sqrt(np.mean(error**2)) < 0.08 * exact.mean(), name

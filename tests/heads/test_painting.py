# SPDX-License-Identifier: GPL-3.0-or-later
"""What is worked out once for all heads gives what it would give head by head; PNG holds the picture."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from generator.heads.parametric.appearance import sample_appearance
from generator.heads.parametric.hair import LOWEST
from generator.heads.parametric.identity import sample_identity
from generator.heads.parametric.layers import darken, lay, mix, put
from generator.heads.parametric.noise import NoiseField, grain, smooth_noise
from generator.heads.parametric.png import png_bytes


@pytest.mark.parametrize("axes", [2, 3])
def test_noise_at_places_that_stay_is_smooth_noise(axes: int) -> None:
    places = tuple(np.random.default_rng(axes).uniform(-100, 100, (axes, 500)))
    kept = NoiseField(*places)
    for seed in range(2):
        wanted = smooth_noise(np.random.default_rng(seed), places)
        np.testing.assert_allclose(kept.draw(np.random.default_rng(seed)), wanted, atol=2e-5)


def test_grain_is_normal_and_a_matter_of_the_generator() -> None:
    first, again, other = (grain(np.random.default_rng(seed), 100_000) for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert abs(first.mean()) < 0.02 and abs(first.std() - 1) < 0.02
    with pytest.raises(ValueError, match="read-only"):
        first[0] = 1


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (97, 31)])
def test_png_holds_the_picture(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    data = png_bytes(pixels)
    assert data == png_bytes(pixels)
    with Image.open(io.BytesIO(data)) as image:
        image.load()  # checks every checksum
        assert image.format == "PNG" and image.mode == "RGB" and not image.info
        assert np.array_equal(np.asarray(image), pixels)


def test_layers_touch_their_texels_alone() -> None:
    color = np.full((3, 5), 0.5, dtype=np.float32)
    lay(color, np.array([1]), np.array([1.0, 0.0, 0.5]), np.array([0.5], dtype=np.float32))
    darken(color, np.array([2]), np.array([0.5], dtype=np.float32), (1.0, 0.5, 0.0))
    put(color, np.array([3]), mix(np.array([0.0, 0.2, 1.0]), np.ones(3), np.array([0.5], dtype=np.float32)))
    assert np.allclose(color[:, [0, 4]], 0.5)
    assert np.allclose(color[:, 1:4].T, [[0.75, 0.25, 0.5], [0.25, 0.375, 0.5], [0.5, 0.6, 1.0]])


def test_no_hair_grows_where_none_is_looked_for() -> None:
    """Texels farther below the usual hairline are left out once for all heads."""
    low = []
    for seed in range(400):
        rng = np.random.default_rng(seed)
        look = sample_appearance(rng, sample_identity(rng))
        low.append(look.fringe - look.hairline)
    assert 0.2 < max(low) <= LOWEST

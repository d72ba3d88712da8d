# SPDX-License-Identifier: MIT
from __future__ import annotations

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.manifold.cosines import (
    FASTEST,
    cosine_slopes,
    cosines,
    fit_cosines,
    fit_manifolds,
    fourier_start,
)
from downstream_hpe.manifold.decomposition import decompose
from downstream_hpe.manifold.plot import plot_manifolds


@pytest.mark.parametrize("samples", [7, 9, 11])
def test_known_cosines_are_recovered(samples):
    true = np.array([[2.0, 1.0, 0.3, -1.0], [0.5, 2.5, -2.0, 0.1], [1.0, 0.6, 1.5, 4.0]])
    angles = np.linspace(-40, 40, samples)
    np.testing.assert_allclose(fit_cosines(cosines(true, angles), angles), true, rtol=1e-5, atol=1e-5)


def test_ideal_poses_have_beta_one():
    fit = decompose(ideal.tensor(ideal.Faces().draw(6, np.random.default_rng(1))))
    for params in fit_manifolds(fit, ideal.AXES).params:
        np.testing.assert_allclose(params[:, 1], 1.0, atol=1e-5)


@pytest.mark.parametrize("samples", [4, 7, 11])
@pytest.mark.parametrize("even", [True, False])
def test_never_worse_than_the_fourier_start(samples, even):
    rng = np.random.default_rng(samples)
    angles = np.linspace(-30, 30, samples)
    if not even:
        angles = angles + rng.uniform(-3, 3, size=samples)
    columns = np.concatenate(
        [rng.normal(size=(samples, 40)), np.sign(rng.normal(size=(samples, 5))), np.eye(samples)], axis=1
    )
    params = fit_cosines(columns, angles)
    assert np.isfinite(params).all()
    lost = ((cosines(params, angles) - columns) ** 2).sum(axis=0)
    for k, column in enumerate(columns.T):
        start = cosines(fourier_start(column, angles)[None], angles)[:, 0]
        assert lost[k] <= ((start - column) ** 2).sum() * (1 + 1e-9) + 1e-20


def test_a_coarse_axis_gives_no_curve_that_only_sampling_could_make():
    """Four values of roll, the least there may be: searched up to Nyquist, beta was 9.0 and alpha 212,995."""
    for angles in (np.linspace(-30, 30, 4), np.array([-90.0, -20, 20, 90])):
        shaken = np.random.default_rng(1).normal(size=(4, 300))
        columns = np.concatenate([shaken, [[1], [-1], [1], [-1]] + 1e-3 * shaken[:, :20]], axis=1)
        params = fit_cosines(columns / np.linalg.norm(columns, axis=0), angles)
        assert params[:, 1].max() <= FASTEST
        assert params[:, 0].max() < 1e3
        if np.diff(angles).min() < 30:
            # Between the samples the curves stay near them.
            middle = cosines(params, np.linspace(angles[0], angles[-1], 50))
            assert np.abs(middle).max() < 10
    with pytest.raises(DataError, match="4° in all are too narrow"):
        fit_cosines(np.ones((5, 1)), np.linspace(-2, 2, 5))


def test_degenerate_columns_stay_tame():
    angles = np.arange(-30.0, 31, 10)
    line = angles / 30
    params = fit_cosines(np.stack([np.full(7, 0.4), np.zeros(7), line, line**2], axis=1), angles)
    np.testing.assert_allclose(params[:2], [[0, 1, 0, 0.4], [0, 1, 0, 0]], atol=1e-12)
    fitted = cosines(params[2:], np.linspace(-45, 45, 19))
    np.testing.assert_allclose(fitted[:, 0], np.linspace(-1.5, 1.5, 19), atol=0.02)
    np.testing.assert_allclose(fitted[:, 1], np.linspace(-1.5, 1.5, 19) ** 2, atol=0.02)


def test_slopes_are_the_derivatives():
    params = np.array([[2.0, 1.3, 0.3, -1.0], [0.5, 2.5, -2.0, 0.1]])
    step = 1e-4
    numeric = (cosines(params, np.array([20 + step])) - cosines(params, np.array([20 - step]))) / np.deg2rad(
        2 * step
    )
    np.testing.assert_allclose(cosine_slopes(params, np.array([20.0])), numeric, rtol=1e-7)


def test_too_few_samples_and_bad_values():
    with pytest.raises(DataError, match="3 angles are too few"):
        fit_cosines(np.ones((3, 1)), np.array([0.0, 1, 2]))
    with pytest.raises(DataError, match="rising"):
        fit_cosines(np.ones((4, 1)), np.array([0.0, 1, 1, 2]))
    with pytest.raises(DataError, match="finite"):
        fit_cosines(np.full((4, 1), np.nan), np.arange(4.0))


@pytest.mark.slow
def test_plot_is_written(tmp_path):
    fit = decompose(ideal.tensor(ideal.Faces().draw(6, np.random.default_rng(1))))
    plot_manifolds(fit, fit_manifolds(fit, ideal.AXES), ideal.AXES, tmp_path / "m.png")
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")

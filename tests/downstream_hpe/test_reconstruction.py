# SPDX-License-Identifier: MIT
from __future__ import annotations

import ideal
import numpy as np
import pytest
from scipy.optimize import minimize

from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.manifold.cosines import fit_manifolds
from downstream_hpe.manifold.decomposition import decompose
from downstream_hpe.manifold.reconstruction import ReconstructionEstimator

BOUNDS = np.array([50, 40, 30])


@pytest.fixture(scope="module")
def estimator():
    fit = decompose(ideal.tensor(ideal.Faces().draw(9, np.random.default_rng(1))))
    return ReconstructionEstimator(fit.core, fit_manifolds(fit, ideal.AXES))


def poses(count, seed=5):
    rng = np.random.default_rng(seed)
    ypr = rng.uniform(-1, 1, size=(count, 3)) * BOUNDS
    return ypr, ideal.turned(ideal.Faces().draw(count, rng), ypr)


def test_new_ideal_faces_off_the_grid_within_a_hundredth(estimator):
    ypr, landmarks = poses(300)  # more than one batch
    found = estimator.from_landmarks(100 + 40 * landmarks)
    assert found.converged.all()
    assert np.abs(found.ypr_deg - ypr).max() < 0.01
    assert found.residual.max() < 1e-6
    features = normalise(landmarks).reshape(300, -1)
    assert estimator.estimate(features, max_steps=4).converged.mean() > 0.9, "frames of a camera do not wait"


def test_residual_is_that_of_the_objective(estimator):
    rng = np.random.default_rng(6)
    _, landmarks = poses(1)
    features = normalise(landmarks + 0.05 * rng.normal(size=landmarks.shape)).reshape(1, -1)
    found = estimator.estimate(features)
    objective = estimator.objective(features[0], found.ypr_deg[0], found.identity[0])
    np.testing.assert_allclose(found.residual[0], np.sqrt(objective / (features[0] ** 2).sum()), rtol=1e-9)


def test_derivatives(estimator):
    ypr, landmarks = poses(4)
    features = normalise(landmarks).reshape(4, -1)
    features = features + 0.05 * np.random.default_rng(6).normal(size=features.shape)
    _, jacobian = estimator.residual_jacobian(features, ypr + 3)
    step = 1e-3
    for axis, shift in enumerate(np.eye(3) * step):
        ahead, _ = estimator.residual_jacobian(features, ypr + 3 + shift)
        behind, _ = estimator.residual_jacobian(features, ypr + 3 - shift)
        numeric = (ahead - behind) / np.deg2rad(2 * step)
        np.testing.assert_allclose(jacobian[..., axis], numeric, atol=1e-6 * np.abs(numeric).max())


def test_no_worse_than_powell(estimator):
    rng = np.random.default_rng(7)
    _, landmarks = poses(1, seed=8)
    feature = normalise(landmarks[0] + 0.05 * rng.normal(size=(468, 3))).ravel()
    found = estimator.estimate(feature[None])
    ours = estimator.objective(feature, found.ypr_deg[0], found.identity[0])
    start = np.concatenate([np.zeros(3), found.identity[0]])
    powell = minimize(
        lambda x: estimator.objective(feature, x[:3], x[3:]), start, method="Powell", options={"maxfev": 4000}
    )
    assert ours <= powell.fun * (1 + 1e-6)


def test_nothing_in_nothing_out(estimator):
    assert estimator.from_landmarks(np.empty((0, 468, 3))).ypr_deg.shape == (0, 3)


def test_angles_stay_where_the_curves_are_known(estimator):
    """What is no face at all used to come back as hundreds of thousands of degrees."""
    found = estimator.from_landmarks(np.random.default_rng(3).normal(size=(60, 468, 3)))
    width = np.ptp(estimator.manifolds.range_deg, axis=1)
    low, high = estimator.manifolds.range_deg.T
    assert (found.ypr_deg >= low - width / 2 - 1e-9).all()
    assert (found.ypr_deg <= high + width / 2 + 1e-9).all()
    assert np.abs(found.ypr_deg).max() > 60

# SPDX-License-Identifier: MIT
from __future__ import annotations

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import ModelError
from downstream_hpe.evaluation.reliability import reliability
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.networks.confidence import QUANTITIES, calibrate, level_faces

RANGE = np.array([[-50.0, 50], [-40, 40], [-30, 30]])
COUNT = 800

pytestmark = pytest.mark.slow


def faces(seed, spread=0.02):
    """Noisy faces at random poses within the range: landmarks, angles."""
    rng = np.random.default_rng(seed)
    ypr = rng.uniform(RANGE[:, 0], RANGE[:, 1], size=(COUNT, 3))
    level = normalise(ideal.Faces().draw(COUNT, rng))
    return ideal.turned(level, ypr) + rng.normal(scale=spread, size=level.shape), ypr


def estimated(ypr, seed):
    """Angles that are off, more so at large yaw."""
    rng = np.random.default_rng(seed)
    return ypr + rng.normal(size=ypr.shape) * (1 + 5 * (np.abs(ypr[:, :1]) / 50) ** 2)


def asked(found, landmarks, ypr):
    features = normalise(landmarks).reshape(len(landmarks), -1)
    return found.of(features, ypr, rotation_from_angles(ypr))


@pytest.fixture(scope="module")
def confidence():
    landmarks, ypr = faces(0)
    level = level_faces(landmarks, rotation_from_angles(ypr), "rms")
    landmarks, ypr = faces(1)
    features, estimate = normalise(landmarks).reshape(COUNT, -1), estimated(ypr, 2)
    found, true = rotation_from_angles(estimate), rotation_from_angles(ypr)
    return calibrate(level, RANGE, features, estimate, found, true, np.ones(COUNT))


def test_what_it_says_comes_true(confidence):
    landmarks, ypr = faces(3)
    estimate = estimated(ypr, 4)
    said = asked(confidence, landmarks, estimate)
    errors = geodesic_errors(rotation_from_angles(estimate), rotation_from_angles(ypr))
    assert said.mean() == pytest.approx((errors < 5).mean(), abs=0.05)
    high, low = said > 0.8, said < 0.4
    assert (errors[high] < 5).mean() > 0.8
    assert (errors[low] < 5).mean() < 0.4
    assert len(reliability(said, errors).splitlines()) > 4


def test_it_falls_beyond_the_range(confidence):
    landmarks, ypr = faces(5)
    inside = asked(confidence, landmarks, ypr).mean()
    further = [np.clip(ypr, None, edge) * [0, 0, 1] + [edge, 0, 0] for edge in (60, 75, 90)]
    means = [asked(confidence, landmarks, there).mean() for there in further]
    assert inside > means[0] > means[1] > means[2]
    # Even where the landmarks fit the estimate as well as they can.
    rng = np.random.default_rng(6)
    turned = ideal.turned(normalise(ideal.Faces().draw(COUNT, rng)), further[1])
    noisy = turned + rng.normal(scale=0.02, size=turned.shape)
    assert asked(confidence, noisy, further[1]).mean() < 0.5 < inside


def test_it_falls_on_what_is_no_face(confidence):
    landmarks, ypr = faces(7)
    rng = np.random.default_rng(8)
    garbage = {
        "noise": rng.normal(size=landmarks.shape),
        "scrambled": landmarks[:, rng.permutation(468)],
        "upside down": landmarks * [1, -1, 1],
        "squashed": landmarks * [0.2, 1, 1],
    }
    for name, points in garbage.items():
        assert asked(confidence, points, ypr).mean() < 0.2, name


def test_estimates_must_be_finite(confidence):
    landmarks, ypr = faces(9)
    level = (confidence.mean, confidence.basis, confidence.scale)
    features, nothing = landmarks.reshape(COUNT, -1), np.full((COUNT, 3), np.nan)
    true = rotation_from_angles(ypr)
    with pytest.raises(ModelError, match="not finite"):
        calibrate(level, RANGE, features, nothing, true, true, np.ones(COUNT))


def test_a_few_rows_decide_nothing(confidence):
    """Ten faces a little beyond the range, all estimated wrongly, do not make it hopeless there."""
    landmarks, ypr = faces(10)
    level = (confidence.mean, confidence.basis, confidence.scale)
    true, estimate = rotation_from_angles(ypr), estimated(ypr, 11)
    there = rotation_from_angles(np.array([0.0, 0, 35]))
    landmarks[:10] = landmarks[:10] @ true[:10] @ there.T
    estimate[:10], true[:10] = [0, 0, 35], rotation_from_angles(np.array([6.0, 0, 35]))
    features, found = normalise(landmarks).reshape(COUNT, -1), rotation_from_angles(estimate)
    again = calibrate(level, RANGE, features, estimate, found, true, np.ones(COUNT))
    assert 400 <= again.weights[QUANTITIES.index("beyond roll")] < 1200
    assert again.of(features, estimate, found)[:10].mean() > 0.15


def test_what_plausibility_takes_is_not_taken_twice(confidence):
    """The graph's probability times the share is what comes true, so the graph alone says more."""
    landmarks, ypr = faces(12)
    level = (confidence.mean, confidence.basis, confidence.scale)
    estimate = ypr + np.random.default_rng(13).normal(scale=3.5, size=ypr.shape)
    share = np.full(COUNT, 0.8)
    features = normalise(landmarks).reshape(COUNT, -1)
    found, true = rotation_from_angles(estimate), rotation_from_angles(ypr)
    graph = calibrate(level, RANGE, features, estimate, found, true, share).of(features, estimate, found)
    plain = calibrate(level, RANGE, features, estimate, found, true, np.ones(COUNT))
    assert graph.mean() > plain.of(features, estimate, found).mean() + 0.02
    assert (0.8 * graph).mean() == pytest.approx((geodesic_errors(found, true) < 5).mean(), abs=0.1)


def test_it_falls_with_what_is_not_seen(confidence):
    landmarks, ypr = faces(14)
    rng = np.random.default_rng(15)
    means = [
        asked(confidence, np.where(rng.random((COUNT, 468, 1)) < share, landmarks, np.nan), ypr).mean()
        for share in (1.0, 0.6, 0.2)
    ]
    assert means[0] > means[1] + 0.03 > means[2] + 0.06

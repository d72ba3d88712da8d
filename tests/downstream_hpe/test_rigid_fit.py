# SPDX-License-Identifier: MIT
"""The rigid fit that the encoder starts from, in torch and in the graph."""

from __future__ import annotations

import ideal
import numpy as np
import pytest

from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import fit_rotation, rotation_from_angles
from downstream_hpe.manifold.cosines import Manifolds

pytestmark = pytest.mark.slow

torch = pytest.importorskip("torch")

from downstream_hpe.networks.confidence import QUANTITIES, Confidence, level_faces  # noqa: E402
from downstream_hpe.networks.export import export_onnx  # noqa: E402
from downstream_hpe.networks.pose_network import REACH, PoseNetwork  # noqa: E402
from downstream_hpe.networks.rigid_fit import ENTRIES, FACTORS, RigidFit  # noqa: E402
from downstream_hpe.networks.weights import NETWORK_FILE, Weights  # noqa: E402

RANGE = np.array([[-50.0, 50], [-40, 40], [-30, 30]])
CURVES = np.array([[0.6, 1.1, 0.2, 0.1], [0.5, 0.9, 1.7, 0.0], [0.4, 2.0, 0.5, -0.2]])
MANIFOLDS = Manifolds((CURVES, CURVES, CURVES), RANGE)


def faces(count, spread=0.03, seed=0):
    """Noisy faces at random poses, also beyond 90 degrees: landmarks normalised, angles."""
    rng = np.random.default_rng(seed)
    ypr = rng.uniform([-89, -120, -170], [89, 120, 170], size=(count, 3))
    level = normalise(mean_head()) + rng.normal(scale=spread, size=(count, 468, 3))
    return normalise(ideal.turned(level, ypr)), ypr


@pytest.fixture(scope="module")
def rigid():
    rng = np.random.default_rng(5)
    return RigidFit.of(normalise(mean_head() + rng.normal(scale=3, size=(60, 468, 3))), MANIFOLDS, 7)


def features(landmarks):
    return torch.from_numpy(landmarks.reshape(len(landmarks), -1).astype(np.float32))


def test_entries_are_those_of_a_quaternions_rotation():
    q = np.array([0.860042174, -0.196628226, 0.463826910, 0.080804689])
    found = (ENTRIES @ np.outer(q, q).ravel()).reshape(3, 3)
    np.testing.assert_allclose(found, rotation_from_angles(np.array([50.0, 40, 30])), atol=1e-8)


def test_it_is_the_rigid_fit_at_any_pose(rigid):
    landmarks, _ = faces(200)
    expected = fit_rotation(rigid.mean.numpy().reshape(468, 3), landmarks)
    np.testing.assert_allclose(rigid.rotation(features(landmarks)).numpy(), expected, atol=1e-5)


def test_it_gives_the_points_of_the_curves_and_shape_alone(rigid):
    landmarks, ypr = faces(50, spread=0)
    start, shape = (part.numpy() for part in rigid(features(landmarks)))
    expected = np.concatenate(MANIFOLDS.values(ypr), axis=1)
    # The mean of 60 noisy faces is a little off that of none.
    np.testing.assert_allclose(start, expected, atol=0.02)
    np.testing.assert_allclose(shape, np.broadcast_to(shape[0], shape.shape), atol=1e-3)


def test_coordinates_have_a_spread_of_one():
    rng = np.random.default_rng(6)
    weights, directions = rng.normal(size=(2000, 3)), rng.normal(scale=5, size=(3, 468, 3))
    level = normalise(mean_head() + np.tensordot(weights, directions, 1))
    three = RigidFit.of(level, MANIFOLDS, 3)
    np.testing.assert_allclose(three(features(level))[1][:, :3].std(dim=0).numpy(), 1, atol=0.02)


@pytest.fixture(scope="module")
def network(rigid):
    torch.manual_seed(1)
    return PoseNetwork((FACTORS + 7 + 1, 16, 9), (3, 8, 1), rigid=rigid).eval()


def test_the_graph_is_the_network(network, tmp_path):
    ort = pytest.importorskip("onnxruntime")
    export_onnx(Weights(network, "rms", RANGE), tmp_path / "m.onnx")
    session = ort.InferenceSession(tmp_path / "m.onnx")
    landmarks, _ = faces(100)
    raw = (200 + 73 * landmarks).astype(np.float32)
    [found] = session.run(["ypr_deg"], {"landmarks": raw})
    with torch.no_grad():
        expected = network(features(normalise(raw))).numpy()
    np.testing.assert_allclose(found, expected, atol=5e-3)


def test_it_comes_back_from_its_file(network, tmp_path):
    Weights(network, "rms", RANGE).save(tmp_path / NETWORK_FILE)
    back = Weights.load(tmp_path / NETWORK_FILE).network
    some = features(faces(5)[0])
    torch.testing.assert_close(back(some), network(some))


def test_an_encoder_never_leaves_the_rigid_fit(network):
    """Whatever it has learned, and whatever it sees."""
    landmarks = np.random.default_rng(2).normal(size=(50, 468, 3))
    seen = features(normalise(landmarks))
    with torch.no_grad():
        start, _ = network.rigid(seen)
        wild = {name: 1e3 * value for name, value in network.encoder.state_dict().items()}
        other = PoseNetwork((FACTORS + 7 + 1, 16, 9), (3, 8, 1), rigid=network.rigid)
        other.encoder.load_state_dict(wild)
        moved = (other.factors(seen) - start).abs()
    assert REACH - 1e-3 < moved.max() <= REACH + 1e-6


def test_an_encoder_of_another_width_is_refused(rigid):
    with pytest.raises(ValueError, match="gives 17"):
        PoseNetwork((1404, 16, 9), rigid=rigid)


def test_geodesic_of_a_noisy_fit_is_small(rigid):
    landmarks, ypr = faces(200, spread=0.02)
    found = rigid.rotation(features(landmarks)).numpy()
    assert geodesic_errors(found, rotation_from_angles(ypr)).mean() < 1


def half(landmarks):
    """Faces of which the points on image right of their middle are not seen."""
    return np.where(
        landmarks[..., :1] > np.median(landmarks[..., :1], axis=1, keepdims=True), np.nan, landmarks
    )


def test_half_a_face_is_where_the_whole_one_is(rigid):
    """Exactly so for the mean face itself: rotation, and no difference of shape."""
    mean = rigid.mean.double().numpy().reshape(1, 468, 3)
    ypr = np.random.default_rng(8).uniform([-85, -40, -40], [85, 40, 40], size=(40, 3))
    seen = half(7 + 3 * ideal.turned(np.repeat(mean, 40, axis=0), ypr))
    start, shape = (part.numpy() for part in rigid(features(normalise(seen))))
    np.testing.assert_allclose(start, np.concatenate(MANIFOLDS.values(ypr), axis=1), atol=2e-3)
    np.testing.assert_allclose(shape[:, :-1], 0, atol=0.03)
    np.testing.assert_allclose(shape[:, -1], np.isnan(seen[..., 0]).mean(axis=1), atol=1e-6)


def test_the_graph_takes_partial_faces(network, tmp_path):
    ort = pytest.importorskip("onnxruntime")
    whole, ypr = faces(400)
    level = level_faces(whole, rotation_from_angles(ypr), "rms")
    confidence = Confidence(*level, RANGE, np.linspace(5, 60, len(QUANTITIES)), 20.0)
    export_onnx(Weights(network, "rms", RANGE, confidence), tmp_path / "m.onnx")
    raw = (200 + 73 * half(whole[:50])).astype(np.float32)
    raw[:5] = np.where(np.arange(468)[:, None] % 6 == 0, raw[:5], np.nan)
    outputs = ["ypr_deg", "rotation", "confidence"]
    session = ort.InferenceSession(tmp_path / "m.onnx")
    found, rotation, chance = session.run(outputs, {"landmarks": raw})
    seen = normalise(raw)
    with torch.no_grad():
        expected = network(features(seen)).numpy()
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, expected, atol=5e-3)
    np.testing.assert_allclose(chance, confidence.of(seen.reshape(50, -1), found, rotation), atol=1e-4)

# SPDX-License-Identifier: MIT
from __future__ import annotations

import json
from dataclasses import replace

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.evaluation.reference import mean_face
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.manifold.decomposition import decompose
from downstream_hpe.manifold.tensor_model import TensorModel
from downstream_hpe.networks.augment import NONE
from downstream_hpe.networks.confidence import calibrate, level_faces
from downstream_hpe.tables.rows import Rows

pytestmark = pytest.mark.slow

torch = pytest.importorskip("torch")
pytest.importorskip("onnxruntime")

from downstream_hpe.networks.export import export_int8, export_onnx  # noqa: E402
from downstream_hpe.networks.pose_network import PoseNetwork, rotation_of  # noqa: E402
from downstream_hpe.networks.recipe import PAPER, Recipe  # noqa: E402
from downstream_hpe.networks.rigid_fit import FACTORS  # noqa: E402
from downstream_hpe.networks.samples import Samples  # noqa: E402
from downstream_hpe.networks.training import train  # noqa: E402
from downstream_hpe.networks.weights import Weights  # noqa: E402
from downstream_hpe.prediction.predictor import Pose, Predictor  # noqa: E402

SMALL = Recipe(layers=(FACTORS + 5 + 1, 32, 9), head_layers=(3, 16, 1), epochs=2, batch=64)
RANGE = np.array([[-50.0, 50], [-40, 40], [-30, 30]])


@pytest.fixture(scope="module")
def rows():
    ypr = np.stack(np.meshgrid(*ideal.AXES, indexing="ij"), axis=-1).reshape(-1, 3)
    faces = ideal.Faces().draw(6, np.random.default_rng(1))
    every = [ideal.turned(np.broadcast_to(face, (len(ypr), 468, 3)), ypr) for face in faces]
    heads = np.repeat([f"{n}/n" for n in range(6)], len(ypr))
    tiled = np.tile(ypr, (6, 1))
    return Rows(heads, heads, tiled, rotation_from_angles(tiled), np.concatenate(every).astype(np.float32), 0)


@pytest.fixture(scope="module")
def model(rows):
    fit = decompose(ideal.tensor(ideal.Faces().draw(6, np.random.default_rng(1))))
    return TensorModel.of(fit, ideal.AXES, mean_face(rows), "rms")


def weights(network):
    return {name: value.numpy() for name, value in network.state_dict().items()}


def test_interrupted_training_gives_the_same_weights(rows, model, tmp_path):
    rows = rows.take(np.arange(0, len(rows), 5))
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    whole = train(rows, model, SMALL, tmp_path / "whole")

    class Stop(Exception):
        pass

    def stop(done, total, loss):
        raise Stop

    with pytest.raises(Stop):
        train(rows, model, SMALL, tmp_path / "parts", stop)
    resumed = []
    parts = train(rows, model, SMALL, tmp_path / "parts", lambda done, total, loss: resumed.append(done))
    assert resumed == [2]
    for name, value in weights(whole).items():
        np.testing.assert_array_equal(value, weights(parts)[name])
    other = train(rows, model, replace(SMALL, seed=1), tmp_path)
    assert not np.array_equal(weights(other)["encoder.0.weight"], weights(whole)["encoder.0.weight"])


def test_a_checkpoint_of_something_else_is_refused(rows, model, tmp_path):
    rows = rows.take(np.arange(0, len(rows), 5))
    train(rows, model, replace(SMALL, epochs=1), tmp_path)
    with pytest.raises(ModelError, match="another recipe or other data"):
        train(rows, model, SMALL, tmp_path)
    (tmp_path / "checkpoint.safetensors").write_bytes(b"no")
    with pytest.raises(ModelError, match="not a readable checkpoint"):
        train(rows, model, SMALL, tmp_path)


def test_an_epoch_goes_over_few_rows_more_than_once(rows, model, tmp_path, monkeypatch):
    """Six heads on 4 x 4 x 4 are two batches; thirty epochs of these teach nothing."""
    drawn = []

    def batch(self, chosen, recipe, rng):
        drawn.append(chosen)
        return whole(self, chosen, recipe, rng)

    whole = Samples.batch
    monkeypatch.setattr(Samples, "batch", batch)
    some = rows.take(np.arange(0, len(rows), 10))
    train(some, model, replace(SMALL, epochs=1, least_steps=5), tmp_path)
    assert len(drawn) >= 5
    seen = np.bincount(np.concatenate(drawn), minlength=len(some))
    assert set(seen) == {seen[0]}


@pytest.mark.parametrize("recipe", [PAPER, Recipe()], ids=["paper", "continuous"])
def test_a_few_epochs_learn(rows, model, tmp_path, recipe):
    losses = []
    # Mixed with their differences, these faces are none that a shape tells anything of.
    whole = replace(recipe, disturbances=NONE)
    layers = (recipe.layers[0], 128, 64, 9)
    short = replace(whole, layers=layers, head_layers=(3, 64, 1), epochs=20, batch=64)
    network = train(rows, model, short, tmp_path, lambda done, total, loss: losses.append(loss))
    # The continuous one starts from the rigid fit, which is not far off already.
    assert losses[-1] < (0.6 if recipe.continuous else 0.2) * losses[0]
    features = torch.from_numpy(normalise(rows.landmarks).reshape(len(rows), -1))
    error = np.abs(network(features).detach().numpy() - rows.ypr_deg).mean()
    assert error < 4


def test_the_papers_recipe_needs_the_grid(rows, model, tmp_path):
    ypr = rows.ypr_deg + 1
    beside = replace(rows, ypr_deg=ypr, rotation=rotation_from_angles(ypr))
    with pytest.raises(ModelError, match="needs poses on the grid"):
        train(beside, model, PAPER, tmp_path)


def test_rotation_in_torch_is_the_convention():
    ypr = np.random.default_rng(0).uniform(-80, 80, size=(20, 3))
    found = rotation_of(torch.from_numpy(ypr)).numpy()
    np.testing.assert_allclose(found, rotation_from_angles(ypr), atol=1e-12)


@pytest.fixture(scope="module")
def confidence(rows):
    """One calibrated on the rows turned by about 5 degrees too far or too little."""
    rng = np.random.default_rng(0)
    some = rows.take(rng.permutation(len(rows))[:300])
    estimates = some.ypr_deg + rng.normal(scale=3, size=(300, 3))
    features = normalise(some.landmarks).reshape(300, -1)
    faces = level_faces(rows.landmarks, rows.rotation, "rms")
    rotation = rotation_from_angles(estimates)
    return calibrate(faces, RANGE, features, estimates, rotation, some.rotation, np.ones(300))


@pytest.mark.parametrize(("normalisation", "share"), [("rms", 1), ("eyes", 1), ("rms", 0.01)])
def test_onnx_equals_torch_from_raw_landmarks(rows, confidence, tmp_path, normalisation, share):
    torch.manual_seed(0)
    network = PoseNetwork().eval()
    # What an untrained network answers is small: within the range, or beyond a share of it. All counts.
    weights = np.array([*confidence.weights[:6], 3e3, 4e3, 5e3, 4e4, 5e4, 6e4, 1e2])
    confidence = replace(confidence, range_deg=share * RANGE, weights=weights)
    export_onnx(Weights(network, normalisation, RANGE, confidence), tmp_path / "model.onnx")
    predictor = Predictor.load(tmp_path)
    raw = (200 + 73 * rows.landmarks[::50]).astype(np.float32)
    # The graph itself: these shapes are no faces, and the predictor would turn them and be less sure.
    session = pytest.importorskip("onnxruntime").InferenceSession(tmp_path / "model.onnx")
    pose = Pose(*session.run(["ypr_deg", "rotation", "confidence"], {"landmarks": raw}))
    features = normalise(raw, normalisation).reshape(len(raw), -1)
    with torch.no_grad():
        expected = network(torch.from_numpy(features)).numpy()
    np.testing.assert_allclose(pose.ypr_deg, expected, atol=5e-5)
    np.testing.assert_allclose(pose.rotation, rotation_from_angles(pose.ypr_deg), atol=1e-5)
    beyond = np.abs(pose.ypr_deg) > share * RANGE[:, 1]
    assert (beyond == (share < 1)).all()
    chance = confidence.of(features, pose.ypr_deg, pose.rotation)
    np.testing.assert_allclose(pose.confidence, chance, atol=1e-5)
    np.testing.assert_array_equal(predictor.range_deg, RANGE)


def test_the_papers_network_in_8_bits(rows, tmp_path):
    torch.manual_seed(0)
    weights = Weights(PoseNetwork().eval(), "rms", RANGE)
    export_onnx(weights, tmp_path / "whole.onnx")
    export_int8(weights, tmp_path / "small.onnx")
    assert (tmp_path / "small.onnx").stat().st_size < 0.3 * (tmp_path / "whole.onnx").stat().st_size
    whole, small = (
        Predictor.load(tmp_path / name).from_landmarks(rows.landmarks[::50]).ypr_deg
        for name in ("whole.onnx", "small.onnx")
    )
    assert np.abs(whole - small).mean() < 0.02 * np.abs(whole).mean()


def test_saved_models_come_back(rows, model, confidence, tmp_path):
    network = PoseNetwork((1404, 16, 9), (3, 8, 1))
    Weights(network, "eyes", RANGE, confidence, ("a", "b")).save(tmp_path / "n.safetensors")
    back = Weights.load(tmp_path / "n.safetensors")
    assert (back.normalisation, back.trained_subjects) == ("eyes", ("a", "b"))
    for name, value in vars(confidence).items():
        np.testing.assert_array_equal(getattr(back.confidence, name), value)
    np.testing.assert_array_equal(back.range_deg, RANGE)
    for name, value in weights(network).items():
        np.testing.assert_array_equal(weights(back.network)[name], value)
    model.save(tmp_path / "t.safetensors")
    again = TensorModel.load(tmp_path / "t.safetensors")
    found = again.estimator().from_landmarks(rows.landmarks[:20])
    assert np.abs(found.ypr_deg - rows.ypr_deg[:20]).max() < 0.01
    with pytest.raises(ModelError, match="expected 'downstream-hpe network 4'"):
        Weights.load(tmp_path / "t.safetensors")


def test_corrupt_and_foreign_models_are_refused_in_one_line(tmp_path):
    onnx = pytest.importorskip("onnx")
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Identity", ["x"], ["y"])],
        "g",
        [onnx.helper.make_tensor_value_info("x", 1, [1])],
        [onnx.helper.make_tensor_value_info("y", 1, [1])],
    )
    foreign = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    for name, content, message in (
        ("pickle.onnx", b"\x80\x04cos\nsystem\n", "not a readable ONNX model"),
        ("empty.onnx", b"", "not a readable ONNX model"),
        ("foreign.onnx", foreign.SerializeToString(), "no downstream-hpe metadata"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ModelError, match=message) as caught:
            Predictor.load(tmp_path / name)
        assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match="no such model"):
        Predictor.load(tmp_path / "nowhere")
    (tmp_path / "t.safetensors").write_bytes(json.dumps({}).encode())
    with pytest.raises(ModelError, match="not a readable model file"):
        TensorModel.load(tmp_path / "t.safetensors")


def test_landmarks_that_are_none_are_refused(tmp_path):
    export_onnx(Weights(PoseNetwork((1404, 8, 9)), "rms", RANGE), tmp_path / "m.onnx")
    predictor = Predictor.load(tmp_path / "m.onnx")
    assert predictor.from_landmarks(np.empty((0, 468, 3))).ypr_deg.shape == (0, 3)
    with pytest.raises(DataError, match=r"\[N, 468, 3\]"):
        predictor.from_landmarks(np.zeros((468, 3)))
    with pytest.raises(DataError, match="not finite"):
        predictor.from_landmarks(np.full((1, 468, 3), np.nan))

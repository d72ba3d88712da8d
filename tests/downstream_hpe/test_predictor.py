# SPDX-License-Identifier: MIT
"""Model files: those that come along, and those that mean harm."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_onnx import FACTS, onnx, tiny_model

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.prediction import onnx_file, predictor
from downstream_hpe.prediction.predictor import Predictor, model_folder

pytest.importorskip("onnxruntime")

FACE = np.random.default_rng(1).normal(size=(2, 468, 3))


def load(model, folder):
    (folder / "m.onnx").write_bytes(model if isinstance(model, bytes) else model.SerializeToString())
    return Predictor.load(folder / "m.onnx")


def test_a_model_by_its_name_or_path(tmp_path, monkeypatch):
    monkeypatch.setattr(predictor, "MODELS", tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError, match="come with this program: none"):
        Predictor.load()
    (tmp_path / "headturn.onnx").write_bytes(tiny_model().SerializeToString())
    (tmp_path / "headturn").mkdir()
    assert Predictor.load().trained_subjects == {"s0", "s1"}
    assert Predictor.load("headturn.onnx").range_deg.tolist() == FACTS["range_deg"]
    # With a folder of that name beside it, the name is still the model's.
    assert model_folder("headturn") is None
    with pytest.raises(ModelError, match=r"headturn/model\.onnx: no such model; .* program: headturn$"):
        Predictor.load("./headturn")


def test_poses_with_and_without_confidence(tmp_path):
    pose = load(tiny_model(), tmp_path).from_landmarks(FACE)
    assert (pose.ypr_deg.shape, pose.rotation.shape, pose.confidence.shape) == ((2, 3), (2, 3, 3), (2,))
    assert ((pose.confidence > 0) & (pose.confidence < 1)).all()
    none = load(tiny_model(), tmp_path).from_landmarks(np.empty((0, 468, 3)))
    assert (none.rotation.shape, none.confidence.shape) == ((0, 3, 3), (0,))
    assert load(tiny_model(confidence=False), tmp_path).from_landmarks(FACE).confidence is None


def test_points_of_irises_are_taken_and_left_out(tmp_path):
    model = load(tiny_model(), tmp_path)
    refined = np.concatenate([FACE, np.full((2, 10, 3), 1e3)], axis=1)
    np.testing.assert_array_equal(model.from_landmarks(refined).ypr_deg, model.from_landmarks(FACE).ypr_deg)
    for points in (FACE[:, :467], refined[:, :477], FACE[0], FACE[..., :2]):
        with pytest.raises(DataError, match=r"shape \[N, 468, 3\] or \[N, 478, 3\], got"):
            model.from_landmarks(points)


def test_missing_points_are_for_models_that_take_partial_faces(tmp_path):
    model = load(tiny_model(), tmp_path)
    half = np.where(np.arange(468)[:, None] < 234, FACE, np.nan)
    with pytest.raises(ModelError, match="takes complete faces, and points are missing"):
        model.from_landmarks(half)
    for points, says in (
        (
            np.where(np.arange(468)[:, None] < 19, FACE, np.nan),
            "19 landmarks of a face, expected at least 20",
        ),
        (np.full_like(FACE, np.nan), "leave out faces that were not detected"),
        (np.where(np.arange(468)[:, None] == 3, np.inf, FACE), "leave out faces that were not detected"),
    ):
        with pytest.raises(DataError, match=says):
            model.from_landmarks(points)


def test_angles_inside_and_outside_the_trained_range(tmp_path):
    inside = load(tiny_model(), tmp_path).in_range(np.array([[50, -40, 30], [51, 0, 0], [0, 0, -31]]))
    assert inside.tolist() == [True, False, False]


def test_numbers_that_are_none_are_never_given(tmp_path):
    broken = tiny_model(facts=FACTS)
    scaled = load(tiny_model(scale=np.inf), tmp_path)
    with pytest.raises(ModelError, match="not finite"):
        scaled.from_landmarks(FACE)
    # A shape that only two landmarks of faces do not fit.
    odd = tiny_model()
    odd.graph.initializer.append(onnx.numpy_helper.from_array(np.array([7, -1]), "seven"))
    odd.graph.node[0].input[0] = "parts"
    odd.graph.node.insert(0, onnx.helper.make_node("Reshape", ["landmarks", "seven"], ["parts"]))
    with pytest.raises(ModelError, match=r"m\.onnx: fails on landmarks \(\w+\); export it again"):
        load(odd, tmp_path).from_landmarks(FACE)
    # 0/0, as normalising does with points that coincide.
    broken.graph.node[0].input[0] = "unit"
    broken.graph.node.insert(0, onnx.helper.make_node("Div", ["landmarks", "landmarks"], ["unit"]))
    whole = load(broken, tmp_path)
    with pytest.raises(DataError, match="all coincide"):
        whole.from_landmarks(np.zeros((1, 468, 3)))


def _external(model):
    tensor = model.graph.initializer[1]
    onnx.external_data_helper.set_external_data(tensor, "../../../../../../../etc/passwd")
    tensor.ClearField("raw_data")


def _external_in_a_node(model):
    value = onnx.TensorProto(data_type=1, dims=[3], data_location=onnx.TensorProto.EXTERNAL)
    model.graph.node.append(onnx.helper.make_node("Constant", [], ["c"], value=value))


def _subgraph(model):
    branch = onnx.helper.make_graph([], "b", [], [])
    node = onnx.helper.make_node("If", ["x"], ["i"], then_branch=branch, else_branch=branch)
    model.graph.node.append(node)


def _memory(model):
    model.graph.node.append(onnx.helper.make_node("ConstantOfShape", ["flat"], ["big"]))


def _foreign_domain(model):
    model.graph.node.append(onnx.helper.make_node("Add", ["x", "x"], ["z"], domain="evil"))


def _function(model):
    model.functions.add(name="f", domain="d")


def _sparse(model):
    model.graph.sparse_initializer.add()


def _huge(model):
    model.graph.initializer[1].dims[:] = [1 << 40, 3]


def _other_shape(model):
    model.graph.input[0].type.tensor_type.shape.dim[1].dim_value = 1 << 40


def _newer(model):
    model.opset_import[0].version = 99


def _newer_format(model):
    model.ir_version = 99


def _other_output(model):
    model.graph.output[0].name = model.graph.node[2].output[0] = "angles"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_external, "its numbers lie in another file"),
        (_external_in_a_node, "its numbers lie in another file"),
        (_subgraph, "subgraphs"),
        (_memory, "the operation 'ConstantOfShape'"),
        (_foreign_domain, r"the operation 'evil\.Add'"),
        (_function, "functions"),
        (_sparse, "sparse"),
        (_huge, "not a readable ONNX model"),
        (_newer, r"onnxruntime [\d.]+ refuses it: \w+; operator set 99 or IR version 8 may be too new"),
        (_newer_format, "operator set 17 or IR version 99 may be too new for it"),
        (_other_shape, "not a readable ONNX model|landmarks is not float"),
        (_other_output, r"ypr_deg is not float \[N, 3\]"),
    ],
)
def test_malicious_and_foreign_models_are_refused_in_one_line(tmp_path, spoil, message):
    model = tiny_model()
    spoil(model)
    with pytest.raises(ModelError, match=message) as caught:
        load(model, tmp_path)
    assert "\n" not in str(caught.value)
    assert "root:" not in str(caught.value)
    # Nor what onnxruntime says of its own source files.
    assert len(str(caught.value)) < 300 and "onnxruntime_src" not in str(caught.value)


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        (None, "no downstream-hpe metadata"),
        ([], "no downstream-hpe metadata"),
        ({**FACTS, "format": "downstream-hpe 9"}, "format 'downstream-hpe 9', expected"),
        ({**FACTS, "range_deg": [[0, float("nan")]] * 3}, "trained range"),
        ({**FACTS, "range_deg": [[0, 1]]}, "trained range"),
    ],
)
def test_metadata_of_something_else(tmp_path, facts, message):
    with pytest.raises(ModelError, match=message):
        load(tiny_model(facts=facts), tmp_path)


def test_a_model_cut_anywhere_or_changed_is_refused_or_read_but_never_more(tmp_path):
    whole = tiny_model().SerializeToString()
    assert onnx_file.fault(whole) is None
    rng = np.random.default_rng(0)
    for at in (*range(60), *rng.integers(60, len(whole), 20)):
        if onnx_file.fault(whole[:at]) is None:
            with pytest.raises(ModelError):
                load(whole[:at], tmp_path)
    for _ in range(200):
        changed = bytearray(whole)
        changed[rng.integers(len(whole))] = rng.integers(256)
        onnx_file.fault(bytes(changed))


def test_a_tag_too_long_for_other_readers_is_no_hiding_place():
    # 13, wire type 2, with a bit beyond 32 set: some readers would cut it to external_data.
    tag = (1 << 32) | (13 << 3) | 2
    hidden = bytes([*((tag >> shift) & 0x7F | 0x80 for shift in (0, 7, 14, 21)), tag >> 28, 0])
    inside = b"\x2a" + bytes([len(hidden)]) + hidden
    assert onnx_file.fault(b"\x3a" + bytes([len(inside)]) + inside) == "it is no ONNX file or cut off"


def test_a_file_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_file, "MAX_BYTES", 100)
    with pytest.raises(ModelError, match="larger than"):
        load(tiny_model(), tmp_path)


def test_metadata_nested_too_deep(tmp_path):
    model = tiny_model(facts=None)
    onnx.helper.set_model_props(model, {"downstream-hpe": "[" * 100_000})
    with pytest.raises(ModelError, match="no downstream-hpe metadata"):
        load(model, tmp_path)

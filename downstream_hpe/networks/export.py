# SPDX-License-Identifier: MIT
"""A trained network as one ONNX graph, from raw landmarks to angles and R_C."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from scipy.linalg import block_diag
from torch import nn

from downstream_hpe.geometry.face_mesh import FEATURES, LEFT_EYE, NOSE_TIP, POINTS, RIGHT_EYE
from downstream_hpe.geometry.metrics import SURE_DEG
from downstream_hpe.geometry.normalise import Normalisation
from downstream_hpe.model_file import packed
from downstream_hpe.networks.confidence import BEYOND_DEG, STRANGE, TURNS, Confidence
from downstream_hpe.networks.pose_network import REACH, PoseNetwork
from downstream_hpe.networks.rigid_fit import ENTRIES, LEAST, SHIFT, SQUARINGS, RigidFit
from downstream_hpe.networks.weights import Weights
from downstream_hpe.prediction.onnx_file import FORMAT, IR_VERSION, OPSET


class _Graph:
    """Nodes and constants, added one by one."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, value: np.ndarray) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def add(self, operation: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        name = output or f"n{len(self.nodes)}"
        self.nodes.append(helper.make_node(operation, list(inputs), [name], **attributes))
        return name

    def array(self, value: np.ndarray) -> str:
        """A constant, float32."""
        return self.constant(np.asarray(value, dtype=np.float32))

    def number(self, value: float) -> str:
        return self.array(np.array(value))

    def linear(self, value: str, weight: np.ndarray, bias: np.ndarray, output: str | None = None) -> str:
        """x W^T + b, weight [out, in]."""
        return self.add("Gemm", value, self.array(weight.T), self.array(bias), output=output)

    def multilayer(self, layers: nn.Module, value: str) -> str:
        for layer in layers.children():
            if isinstance(layer, nn.Linear):
                value = self.linear(value, layer.weight.detach().numpy(), layer.bias.detach().numpy())
            else:
                value = self.add({nn.ReLU: "Relu", nn.Tanh: "Tanh"}[type(layer)], value)
        return value


def export_onnx(weights: Weights, path: Path) -> None:
    """Write the graph: landmarks float32 [N, 468, 3], any unit -> ypr_deg [N, 3], rotation [N, 3, 3]
    and, where it was calibrated, confidence [N].

    Its metadata, JSON under "downstream-hpe", hold the format, the normalisation, the angles trained
    on and the subjects trained on.
    """
    network, normalisation = weights.network, weights.normalisation
    graph = _Graph()
    scaled = _normalised(graph, normalisation)
    features = graph.add("Reshape", scaled, graph.constant(np.array([-1, FEATURES])))
    _heads(graph, network, _factors(graph, network, scaled, features))
    _rotation(graph)
    outputs: list[tuple[str, list[str | int]]] = [("ypr_deg", ["N", 3]), ("rotation", ["N", 3, 3])]
    if weights.confidence is not None:
        _confidence(graph, weights.confidence, scaled)
        outputs.append(("confidence", ["N"]))
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "head_pose",
            [helper.make_tensor_value_info("landmarks", TensorProto.FLOAT, ["N", POINTS, 3])],
            [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="downstream-hpe",
    )
    facts = {
        "normalisation": normalisation,
        "range_deg": weights.range_deg.tolist(),
        "trained_subjects": list(weights.trained_subjects),
        "pose_zero": weights.pose_zero,
    }
    helper.set_model_props(model, packed(FORMAT, facts))
    onnx.checker.check_model(model, full_check=True)
    path.write_bytes(model.SerializeToString(deterministic=True))


def export_int8(weights: Weights, path: Path) -> None:
    """The same graph with matrices of 8-bit integers, a scale a column; the rest is computed as before.

    A quarter of the size, and quicker where reading the weights takes the time, as in the paper's network.
    Not for the continuous recipe, whose first layer holds differences too fine for 8 bits.
    """
    from onnxruntime.quantization import QuantType, quantize_dynamic

    # It notes on its logger that shapes were not inferred before, which the export has done.
    logging.getLogger().addFilter(_no_preprocessing_note)
    try:
        with tempfile.TemporaryDirectory() as folder:
            whole = Path(folder) / "whole.onnx"
            export_onnx(weights, whole)
            quantize_dynamic(whole, path, per_channel=True, weight_type=QuantType.QInt8)
    finally:
        logging.getLogger().removeFilter(_no_preprocessing_note)


def _no_preprocessing_note(record: logging.LogRecord) -> bool:
    return "pre-processing" not in record.getMessage()


def _normalised(graph: _Graph, normalisation: Normalisation) -> str:
    """:func:`downstream_hpe.geometry.normalise.normalise`: [N, 468, 3]."""
    if normalisation == "rms":
        centre = graph.add("ReduceMean", "landmarks", axes=[1], keepdims=1)
    else:
        centre = graph.add("Gather", "landmarks", graph.constant(np.array([NOSE_TIP])), axis=1)
    centred = graph.add("Sub", "landmarks", centre)
    if normalisation == "rms":
        squares = graph.add("ReduceSumSquare", centred, axes=[1, 2], keepdims=1)
        scale = graph.add("Sqrt", graph.add("Mul", squares, graph.number(1 / POINTS)))
    else:
        ends = (
            graph.add("Gather", "landmarks", graph.constant(np.array([i])), axis=1)
            for i in (RIGHT_EYE, LEFT_EYE)
        )
        scale = graph.add("ReduceL2", graph.add("Sub", *ends), axes=[2], keepdims=1)
    return graph.add("Div", centred, scale)


def _factors(graph: _Graph, network: PoseNetwork, scaled: str, features: str) -> str:
    """:meth:`downstream_hpe.networks.pose_network.PoseNetwork.factors`."""
    if network.rigid is None:
        return graph.multilayer(network.encoder, features)
    start, shape = _rigid_fit(graph, network.rigid, scaled, features)
    moved = graph.multilayer(network.encoder, graph.add("Concat", start, shape, axis=1))
    return graph.add("Add", start, graph.add("Mul", graph.add("Tanh", moved), graph.number(REACH)))


def _rigid_fit(graph: _Graph, rigid: RigidFit, scaled: str, features: str) -> tuple[str, str]:
    """:class:`downstream_hpe.networks.rigid_fit.RigidFit`: factor vectors [N, 9], coordinates [N, K]."""
    flat = graph.add("MatMul", features, graph.array(rigid.matrix()))
    size = graph.add("ReduceL2", flat, axes=[1], keepdims=1)
    unit = graph.add("Div", flat, graph.add("Add", size, graph.number(LEAST)))
    shifted = graph.add("Add", unit, graph.array(SHIFT * np.eye(4).reshape(1, 16)))
    powers = graph.add("Reshape", shifted, graph.constant(np.array([-1, 4, 4])))
    for _ in range(SQUARINGS):
        powers = graph.add("MatMul", powers, powers)
    flat = graph.add("Reshape", powers, graph.constant(np.array([-1, 16])))
    trace = graph.add("MatMul", flat, graph.array(np.eye(4).reshape(16, 1)))
    entries = graph.add("MatMul", graph.add("Div", flat, trace), graph.array(ENTRIES.T))
    rotation = graph.add("Reshape", entries, graph.constant(np.array([-1, 3, 3])))
    level = graph.add(
        "Reshape", graph.add("MatMul", scaled, rotation), graph.constant(np.array([-1, FEATURES]))
    )
    mean, basis = (value.double().numpy() for value in (rigid.mean, rigid.basis))
    shape = graph.linear(level, basis.T, -mean @ basis)
    alpha, beta, gamma, phi = rigid.curves.double().numpy().T
    turns = np.repeat(np.eye(3), len(beta) // 3, axis=0) * beta[:, None]
    cosines = graph.add("Cos", graph.linear(_angles(graph, entries), turns, gamma))
    start = graph.add("Add", graph.add("Mul", cosines, graph.array(alpha)), graph.array(phi))
    return start, shape


def _angles(graph: _Graph, entries: str) -> str:
    """Yaw, pitch and roll in radians of the entries of R_C, [N, 9] -> [N, 3].

    atan2(y, x) = 2 atan(y / (r + x)), of yaw with x = cos yaw and r = 1; of the others r = cos yaw.
    """
    cosine = graph.add(
        "ReduceL2",
        graph.add("Gather", entries, graph.constant(np.array([5, 8])), axis=1),
        axes=[1],
        keepdims=1,
    )
    above, below = np.zeros((9, 3)), np.zeros((9, 3))
    above[[2, 5, 1], [0, 1, 2]] = 1, 1, -1
    below[[8, 0], [1, 2]] = 1
    right = graph.add(
        "Add", graph.add("MatMul", entries, graph.array(below)), graph.array(np.array([[1.0, LEAST, LEAST]]))
    )
    ratio = graph.add(
        "Div", graph.add("MatMul", entries, graph.array(above)), graph.add("Add", right, cosine)
    )
    return graph.add("Mul", graph.add("Atan", ratio), graph.number(2.0))


def _heads(graph: _Graph, network: PoseNetwork, factors: str) -> None:
    """The three heads side by side, each layer one matrix with three blocks; and the output ypr_deg.

    The zeros between the blocks cost less than the three times as many operations without them.
    """
    chains = [[layer for layer in head.children() if isinstance(layer, nn.Linear)] for head in network.heads]
    value = factors
    for k, layers in enumerate(zip(*chains, strict=True)):
        if k:
            value = graph.add("Relu", value)
        weight = block_diag(*(layer.weight.detach().numpy() for layer in layers))
        bias = np.concatenate([layer.bias.detach().numpy() for layer in layers])
        last = k == len(chains[0]) - 1
        if last:
            scale = network.scale_deg.numpy()
            weight, bias = weight * scale[:, None], bias * scale
        value = graph.linear(value, weight, bias, "ypr_deg" if last else None)


# R_C = Rx(-pitch) Ry(yaw) Rz(roll), row-major: each entry is a sum of products of up to three of
# the cosines and sines of yaw, pitch and roll, and 1.
_CY, _CP, _CR, _ONE, _SY, _SP, _SR = range(7)
_TERMS = (
    (0, 1, (_CY, _CR, _ONE)), (1, -1, (_CY, _SR, _ONE)), (2, 1, (_SY, _ONE, _ONE)),
    (3, 1, (_CP, _SR, _ONE)), (3, -1, (_SP, _SY, _CR)), (4, 1, (_CP, _CR, _ONE)),
    (4, 1, (_SP, _SY, _SR)), (5, 1, (_SP, _CY, _ONE)), (6, -1, (_SP, _SR, _ONE)),
    (6, -1, (_CP, _SY, _CR)), (7, -1, (_SP, _CR, _ONE)), (7, 1, (_CP, _SY, _SR)), (8, 1, (_CP, _CY, _ONE)),
)  # fmt: skip
"""(entry, sign, factors)."""


def _rotation(graph: _Graph) -> None:
    """R_C from the output ypr_deg."""
    # A fourth angle, always 0, whose cosine is the 1.
    radians = graph.add("MatMul", "ypr_deg", graph.array(np.eye(3, 4) * (np.pi / 180)))
    values = graph.add("Concat", graph.add("Cos", radians), graph.add("Sin", radians), axis=1)
    picked = [
        graph.add("Gather", values, graph.constant(np.array([term[2][k] for term in _TERMS])), axis=1)
        for k in range(3)
    ]
    products = graph.add("Mul", graph.add("Mul", picked[0], picked[1]), picked[2])
    sums = np.zeros((len(_TERMS), 9), dtype=np.float32)
    for row, (entry, sign, _) in enumerate(_TERMS):
        sums[row, entry] = sign
    flat = graph.add("MatMul", products, graph.constant(sums))
    graph.add("Reshape", flat, graph.constant(np.array([-1, 3, 3])), output="rotation")


def _confidence(graph: _Graph, confidence: Confidence, scaled: str) -> None:
    """:meth:`downstream_hpe.networks.confidence.Confidence.of` the outputs ypr_deg and rotation."""
    level = graph.add("MatMul", scaled, "rotation")
    flat = graph.add("Reshape", level, graph.constant(np.array([-1, FEATURES])))
    residual = graph.add("Sub", flat, graph.array(confidence.mean))
    # With columns divided by their scale, sums of squares are all that is left.
    turns, rest = slice(0, TURNS), slice(TURNS, None)
    found = graph.add("MatMul", residual, graph.array(confidence.basis))
    parts = graph.add("Mul", found, found)
    whole = graph.add("ReduceSumSquare", residual, axes=[1], keepdims=1)
    sums = np.zeros((confidence.basis.shape[1] + 1, 3))
    sums[0, 0] = 1 / confidence.scale[-1]
    sums[1:, 0] = -1 / confidence.scale[-1]
    sums[1:, 1][rest] = 1 / confidence.scale[:-1][rest]
    sums[1:, 2][turns] = 1 / confidence.scale[:-1][turns]
    squares = graph.add("MatMul", graph.add("Concat", whole, parts, axis=1), graph.array(sums))
    sizes = graph.add("Sqrt", graph.add("Relu", squares))
    strange = graph.add("Relu", graph.add("Sub", sizes, graph.number(STRANGE)))
    middle, half = confidence.range_deg.mean(axis=1), np.ptp(confidence.range_deg, axis=1) / 2
    place = graph.add("Abs", graph.add("Sub", "ypr_deg", graph.array(middle)))
    beyond = graph.add("Relu", graph.add("Sub", place, graph.array(half)))
    inside = graph.add("Sub", place, beyond)
    # The angles' units are degrees here; the weights take them as Confidence.quantities has them.
    parts = graph.add("Concat", strange, inside, beyond, axis=1)
    squared = graph.add("Mul", parts, parts)
    quantities = graph.add("Concat", sizes, squared, axis=1)
    units = np.concatenate([np.ones(6), half**2, np.full(3, BEYOND_DEG**2)])
    expected = graph.linear(quantities, (confidence.weights / units)[None], np.array([confidence.bias]))
    beyond_it = graph.add("Exp", graph.add("Div", graph.number(-(SURE_DEG**2)), expected))
    chance = graph.add("Sub", graph.number(1.0), beyond_it)
    graph.add("Reshape", chance, graph.constant(np.array([-1])), output="confidence")

# SPDX-License-Identifier: MIT
"""A trained network as one ONNX graph, from raw landmarks to angles and R_C."""

from __future__ import annotations

import logging
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper
from scipy.linalg import block_diag
from torch import nn

from downstream_hpe.geometry.face_mesh import FEATURES, LEFT_EYE, NOSE_TIP, POINTS, RIGHT_EYE
from downstream_hpe.geometry.metrics import SURE_DEG
from downstream_hpe.geometry.normalise import Normalisation
from downstream_hpe.model_file import packed
from downstream_hpe.networks.confidence import BEYOND_DEG, STRANGE, TURNS, Confidence
from downstream_hpe.networks.graph import Graph
from downstream_hpe.networks.pose_network import REACH, PoseNetwork
from downstream_hpe.networks.rigid_fit import ENTRIES, LEAST, SHIFT, SQUARINGS, RigidFit
from downstream_hpe.networks.weights import Weights
from downstream_hpe.prediction.onnx_file import FORMAT, IR_VERSION, OPSET


def export_onnx(weights: Weights, path: Path) -> None:
    """Write the graph: landmarks float32 [N, 468, 3], any unit -> ypr_deg [N, 3], rotation [N, 3, 3]
    and, where it was calibrated, confidence [N].

    Where the network starts from a rigid fit it takes partial faces, too: a point that is not seen is NaN.
    Its metadata, JSON under "downstream-hpe", say so ("partial"), and hold the format, the normalisation,
    the angles trained on and the subjects trained on.
    """
    network, normalisation = weights.network, weights.normalisation
    graph = Graph()
    seen = None if network.rigid is None else _seen(graph)
    scaled = _normalised(graph, normalisation, seen)
    features = graph.shaped(scaled, -1, FEATURES)
    _heads(graph, network, _factors(graph, network, scaled, features, seen))
    _rotation(graph)
    outputs: list[tuple[str, list[str | int]]] = [("ypr_deg", ["N", 3]), ("rotation", ["N", 3, 3])]
    if weights.confidence is not None:
        _confidence(graph, weights.confidence, scaled, seen)
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
        "partial": network.rigid is not None and normalisation == "rms",
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


@dataclass(frozen=True)
class _Seen:
    """points [N, 468, 3], 0 where not seen. each [N, 468, 1] and flat [N, 468]: 1 where seen, or 0. count and
    share of those [N, 1]."""

    points: str
    each: str
    flat: str
    count: str
    share: str


def _seen(graph: Graph) -> _Seen:
    whole = graph.add("ReduceSum", "landmarks", graph.constant(np.array([2])), keepdims=1)
    unknown = graph.add("IsNaN", whole)
    points = graph.add("Where", unknown, graph.number(0.0), "landmarks")
    each = graph.add("Cast", graph.add("Not", unknown), to=TensorProto.FLOAT)
    flat = graph.shaped(each, -1, POINTS)
    count = graph.add("ReduceSum", flat, graph.constant(np.array([1])), keepdims=1)
    return _Seen(points, each, flat, count, graph.add("Mul", count, graph.number(1 / POINTS)))


def _normalised(graph: Graph, normalisation: Normalisation, seen: _Seen | None) -> str:
    """:func:`downstream_hpe.geometry.normalise.normalise`: [N, 468, 3]; 0 where a point is not seen."""
    points = "landmarks" if seen is None else seen.points
    if normalisation == "eyes":
        centred = graph.add("Sub", points, graph.point(points, NOSE_TIP))
        eyes = graph.add("Sub", graph.point(points, RIGHT_EYE), graph.point(points, LEFT_EYE))
        scale = graph.add("ReduceL2", eyes, axes=[2], keepdims=1)
    elif seen is None:
        centred = graph.add("Sub", points, graph.add("ReduceMean", points, axes=[1], keepdims=1))
        squares = graph.add("ReduceSumSquare", centred, axes=[1, 2], keepdims=1)
        scale = graph.add("Sqrt", graph.add("Mul", squares, graph.number(1 / POINTS)))
    else:
        count = graph.shaped(seen.count, -1, 1, 1)
        sums = graph.add("ReduceSum", points, graph.constant(np.array([1])), keepdims=1)
        centred = graph.add("Sub", points, graph.add("Div", sums, count))
        centred = graph.add("Mul", centred, seen.each)
        squares = graph.add("ReduceSumSquare", centred, axes=[1, 2], keepdims=1)
        scale = graph.add("Sqrt", graph.add("Div", squares, count))
    return graph.add("Div", centred, scale)


def _residual(graph: Graph, level: str, mean: np.ndarray, seen: _Seen | None) -> str:
    """Level faces [N, 468, 3] less a mean face [468, 3], moved to where that has the points that are seen; 0
    where they are not: :func:`downstream_hpe.geometry.partial.among`. [N, 1404]."""
    if seen is None:
        return graph.shaped(graph.add("Sub", level, graph.array(mean)), -1, FEATURES)
    centred = mean - mean.mean(axis=0)
    squares = np.square(centred).sum(axis=1, keepdims=True)
    scale = squares.mean()
    sums = graph.add("MatMul", seen.flat, graph.array(np.hstack([centred, squares / scale])))
    means = graph.add("Div", sums, seen.count)
    centre = graph.add("Gather", means, graph.constant(np.arange(3)), axis=1)
    of_squares = graph.add("Gather", means, graph.constant(np.array([3])), axis=1)
    off = graph.add("ReduceSumSquare", centre, axes=[1], keepdims=1)
    spread = graph.add("Sqrt", graph.add("Sub", of_squares, graph.add("Mul", off, graph.number(1 / scale))))
    scaled = graph.add("Mul", level, graph.shaped(spread, -1, 1, 1))
    placed = graph.add("Add", scaled, graph.shaped(centre, -1, 1, 3))
    residual = graph.add("Mul", graph.add("Sub", placed, graph.array(mean)), seen.each)
    return graph.shaped(residual, -1, FEATURES)


def _factors(graph: Graph, network: PoseNetwork, scaled: str, features: str, seen: _Seen | None) -> str:
    """:meth:`downstream_hpe.networks.pose_network.PoseNetwork.factors`."""
    if network.rigid is None:
        return graph.multilayer(network.encoder, features)
    assert seen is not None
    start, shape = _rigid_fit(graph, network.rigid, scaled, features, seen)
    unseen = graph.add("Sub", graph.number(1.0), seen.share)
    moved = graph.multilayer(network.encoder, graph.add("Concat", start, shape, unseen, axis=1))
    return graph.add("Add", start, graph.add("Mul", graph.add("Tanh", moved), graph.number(REACH)))


def _rigid_fit(graph: Graph, rigid: RigidFit, scaled: str, features: str, seen: _Seen) -> tuple[str, str]:
    """:class:`downstream_hpe.networks.rigid_fit.RigidFit`: factor vectors [N, 9], coordinates [N, K]."""
    flat = graph.add("MatMul", features, graph.array(rigid.matrix()))
    size = graph.add("ReduceL2", flat, axes=[1], keepdims=1)
    unit = graph.add("Div", flat, graph.add("Add", size, graph.number(LEAST)))
    shifted = graph.add("Add", unit, graph.array(SHIFT * np.eye(4).reshape(1, 16)))
    powers = graph.shaped(shifted, -1, 4, 4)
    for _ in range(SQUARINGS):
        powers = graph.add("MatMul", powers, powers)
    flat = graph.shaped(powers, -1, 16)
    trace = graph.add("MatMul", flat, graph.array(np.eye(4).reshape(16, 1)))
    entries = graph.add("MatMul", graph.add("Div", flat, trace), graph.array(ENTRIES.T))
    rotation = graph.shaped(entries, -1, 3, 3)
    mean, basis = rigid.mean.double().numpy().reshape(POINTS, 3), rigid.basis.double().numpy()
    residual = _residual(graph, graph.add("MatMul", scaled, rotation), mean, seen)
    shape = graph.add("Div", graph.add("MatMul", residual, graph.array(basis)), seen.share)
    alpha, beta, gamma, phi = rigid.curves.double().numpy().T
    turns = np.repeat(np.eye(3), len(beta) // 3, axis=0) * beta[:, None]
    cosines = graph.add("Cos", graph.linear(_angles(graph, entries), turns, gamma))
    start = graph.add("Add", graph.add("Mul", cosines, graph.array(alpha)), graph.array(phi))
    return start, shape


def _angles(graph: Graph, entries: str) -> str:
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


def _heads(graph: Graph, network: PoseNetwork, factors: str) -> None:
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


def _rotation(graph: Graph) -> None:
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


def _confidence(graph: Graph, confidence: Confidence, scaled: str, seen: _Seen | None) -> None:
    """:meth:`downstream_hpe.networks.confidence.Confidence.of` the outputs ypr_deg and rotation."""
    mean = confidence.mean.reshape(POINTS, 3)
    residual = _residual(graph, graph.add("MatMul", scaled, "rotation"), mean, seen)
    if seen is not None:
        residual = graph.add("Div", residual, graph.add("Sqrt", seen.share))
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
    unseen = [] if seen is None else [graph.add("Sub", graph.number(1.0), seen.share)]
    quantities = graph.add("Concat", sizes, squared, *unseen, axis=1)
    units = np.concatenate([np.ones(6), half**2, np.full(3, BEYOND_DEG**2)])
    weights = np.concatenate([confidence.weights[:-1] / units, confidence.weights[-1:][: len(unseen)]])
    expected = graph.linear(quantities, weights[None], np.array([confidence.bias]))
    beyond_it = graph.add("Exp", graph.add("Div", graph.number(-(SURE_DEG**2)), expected))
    chance = graph.add("Sub", graph.number(1.0), beyond_it)
    graph.add("Reshape", chance, graph.constant(np.array([-1])), output="confidence")

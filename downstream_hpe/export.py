# SPDX-License-Identifier: MIT
"""A trained network as one ONNX graph, from raw landmarks to angles and R_C."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from downstream_hpe.model import packed
from downstream_hpe.networks import Weights
from downstream_hpe.normalise import EYE_A, EYE_B, FEATURES, ORIGIN, POINTS, Normalisation
from downstream_hpe.predictor import FORMAT

OPSET = 17


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

    def split(self, value: str, parts: int) -> list[str]:
        """Equal parts along axis 1."""
        names = [f"n{len(self.nodes)}_{k}" for k in range(parts)]
        self.nodes.append(helper.make_node("Split", [value], names, axis=1))
        return names

    def multilayer(self, layers: nn.Module, value: str) -> str:
        for layer in layers.children():
            if isinstance(layer, nn.Linear):
                weight, bias = (self.constant(p.detach().numpy()) for p in (layer.weight, layer.bias))
                value = self.add("Gemm", value, weight, bias, transB=1)
            else:
                value = self.add({nn.ReLU: "Relu", nn.Tanh: "Tanh"}[type(layer)], value)
        return value


def export_onnx(weights: Weights, path: Path) -> None:
    """Write the graph: landmarks float32 [N, 468, 3], any unit -> ypr_deg [N, 3], rotation [N, 3, 3].

    Its metadata, JSON under "downstream-hpe", hold the format, the normalisation and the angles
    trained on.
    """
    network, normalisation = weights.network, weights.normalisation
    graph = _Graph()
    value = _normalised(graph, normalisation)
    factors = graph.multilayer(network.encoder, value)
    angles = []
    for part, head in zip(graph.split(factors, 3), network.heads, strict=True):
        angles.append(graph.multilayer(head, part))
    joined = graph.add("Concat", *angles, axis=1)
    graph.add("Mul", joined, graph.constant(network.scale_deg.numpy()), output="ypr_deg")
    _rotation(graph)
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "head_pose",
            [helper.make_tensor_value_info("landmarks", TensorProto.FLOAT, ["N", POINTS, 3])],
            [
                helper.make_tensor_value_info("ypr_deg", TensorProto.FLOAT, ["N", 3]),
                helper.make_tensor_value_info("rotation", TensorProto.FLOAT, ["N", 3, 3]),
            ],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=8,
        producer_name="downstream-hpe",
    )
    facts = {"normalisation": normalisation, "range_deg": weights.range_deg.tolist()}
    helper.set_model_props(model, packed(FORMAT, facts))
    onnx.checker.check_model(model, full_check=True)
    path.write_bytes(model.SerializeToString(deterministic=True))


def _normalised(graph: _Graph, normalisation: Normalisation) -> str:
    """:func:`downstream_hpe.normalise.normalise`, flattened to [N, 1404]."""
    if normalisation == "rms":
        centre = graph.add("ReduceMean", "landmarks", axes=[1], keepdims=1)
    else:
        centre = graph.add("Gather", "landmarks", graph.constant(np.array([ORIGIN])), axis=1)
    centred = graph.add("Sub", "landmarks", centre)
    if normalisation == "rms":
        squares = graph.add("Mul", centred, centred)
        size = graph.add("ReduceSum", squares, graph.constant(np.array([2])), keepdims=1)
        scale = graph.add("Sqrt", graph.add("ReduceMean", size, axes=[1], keepdims=1))
    else:
        ends = (
            graph.add("Gather", "landmarks", graph.constant(np.array([i])), axis=1) for i in (EYE_A, EYE_B)
        )
        scale = graph.add("ReduceL2", graph.add("Sub", *ends), axes=[2], keepdims=1)
    scaled = graph.add("Div", centred, scale)
    return graph.add("Reshape", scaled, graph.constant(np.array([-1, FEATURES])))


def _rotation(graph: _Graph) -> None:
    """R_C = Rx(-pitch) Ry(yaw) Rz(roll) from the output ypr_deg."""
    radians = graph.add("Mul", "ypr_deg", graph.constant(np.array(np.pi / 180, dtype=np.float32)))
    cy, cp, cr = graph.split(graph.add("Cos", radians), 3)
    sy, sp, sr = graph.split(graph.add("Sin", radians), 3)

    def times(a: str, b: str) -> str:
        return graph.add("Mul", a, b)

    spsy, cpsy = times(sp, sy), times(cp, sy)
    entries = [
        times(cy, cr),
        graph.add("Neg", times(cy, sr)),
        sy,
        graph.add("Sub", times(cp, sr), times(spsy, cr)),
        graph.add("Add", times(cp, cr), times(spsy, sr)),
        times(sp, cy),
        graph.add("Neg", graph.add("Add", times(sp, sr), times(cpsy, cr))),
        graph.add("Sub", times(cpsy, sr), times(sp, cr)),
        times(cp, cy),
    ]
    flat = graph.add("Concat", *entries, axis=1)
    graph.add("Reshape", flat, graph.constant(np.array([-1, 3, 3])), output="rotation")

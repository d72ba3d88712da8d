# SPDX-License-Identifier: MIT
"""A graph of the form that is exported, but linear and small, made without torch."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from downstream_hpe.prediction.onnx_file import FORMAT

onnx = pytest.importorskip("onnx")

FACTS = {
    "format": FORMAT,
    "range_deg": [[-50, 50], [-40, 40], [-30, 30]],
    "normalisation": "rms",
    "trained_subjects": ["s0", "s1"],
}


def tiny_model(confidence: bool = True, facts: Any = FACTS, scale: float = 1.0) -> Any:
    """An onnx.ModelProto. facts: its metadata, None for none at all."""
    outputs = [("ypr_deg", [3]), ("rotation", [3, 3]), *([("confidence", [])] if confidence else [])]
    arrays = {"flat": np.array([-1, 1404])}
    nodes = [onnx.helper.make_node("Reshape", ["landmarks", "flat"], ["x"])]
    rng = np.random.default_rng(0)
    for name, shape in outputs:
        weight = scale * rng.normal(size=(1404, int(np.prod(shape)))) / 1404
        arrays |= {f"w_{name}": weight.astype(np.float32), f"s_{name}": np.array([-1, *shape])}
        nodes.append(onnx.helper.make_node("MatMul", ["x", f"w_{name}"], [f"y_{name}"]))
        reshaped = name if name != "confidence" else "logit"
        nodes.append(onnx.helper.make_node("Reshape", [f"y_{name}", f"s_{name}"], [reshaped]))
    if confidence:
        nodes.append(onnx.helper.make_node("Sigmoid", ["logit"], ["confidence"]))
    graph = onnx.helper.make_graph(
        nodes,
        "tiny",
        [onnx.helper.make_tensor_value_info("landmarks", onnx.TensorProto.FLOAT, ["N", 468, 3])],
        [onnx.helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, ["N", *s]) for n, s in outputs],
        [onnx.numpy_helper.from_array(value, name) for name, value in arrays.items()],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    if facts is not None:
        onnx.helper.set_model_props(model, {"downstream-hpe": json.dumps(facts)})
    return model

# SPDX-License-Identifier: MIT
"""A graph of ONNX while it is being made: nodes and constants, added one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from onnx import helper, numpy_helper
from torch import nn


class Graph:
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

    def shaped(self, value: str, *shape: int) -> str:
        """Of another shape; -1 is what is left."""
        return self.add("Reshape", value, self.constant(np.array(shape)))

    def point(self, landmarks: str, index: int) -> str:
        """One of the landmarks [N, P, 3]: [N, 1, 3]."""
        return self.add("Gather", landmarks, self.constant(np.array([index])), axis=1)

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

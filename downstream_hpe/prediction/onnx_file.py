# SPDX-License-Identifier: MIT
"""The ONNX file of a model: its form, and what it may hold before onnxruntime is let near it.

A file of `downstream-hpe export` is arithmetic on tensors that lie in the file. ONNX allows more: tensors
in other files, which onnxruntime before 1.25 reads from anywhere, subgraphs, and shapes made up at load
time that fill the memory. Nothing of that is needed here, so it is refused.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from downstream_hpe.geometry.face_mesh import POINTS

FORMAT = "downstream-hpe 1"
"""Said in the metadata of every file."""
SHAPES = {"landmarks": [POINTS, 3], "ypr_deg": [3], "rotation": [3, 3], "confidence": []}
"""The graph's input and outputs, after the first axis; confidence may be missing."""
MAX_BYTES = 64_000_000
OPSET, IR_VERSION = 17, 8
"""Versions of ONNX's operators and of its format in which models are exported."""

_NAMES = """
    Abs Acos Add And Asin Atan Cast Clip Concat Constant Cos DequantizeLinear Div DynamicQuantizeLinear
    Elu Equal Erf Exp Flatten Floor Gather Gelu Gemm Greater GreaterOrEqual Identity LayerNormalization
    LeakyRelu Less LessOrEqual Log MatMul MatMulInteger Max Min Mul Neg Not Or Pow PRelu QuantizeLinear
    Reciprocal ReduceL2 ReduceMax ReduceMean ReduceMin ReduceSum ReduceSumSquare Relu Reshape Selu Shape
    Sigmoid Sign Sin Slice Softmax Softplus Split Sqrt Squeeze Sub Tan Tanh Transpose Unsqueeze Where
"""
OPERATIONS = frozenset(_NAMES.split())
"""Their outputs are about as large as their inputs."""

# Field numbers of onnx.proto, by message.
_IR_VERSION, _GRAPH, _OPSET = 1, 7, 8  # ModelProto
_TRAINING, _FUNCTIONS = 20, 25
_VERSION = 2  # OperatorSetIdProto
_NODE, _INITIALIZER, _SPARSE_INITIALIZER = 1, 5, 15  # GraphProto
_OPERATION, _ATTRIBUTE, _DOMAIN = 4, 5, 7  # NodeProto
_TENSOR, _TENSORS = 5, 10  # AttributeProto
_SUBGRAPHS = {6, 11, 22, 23}  # graphs and sparse tensors
_EXTERNAL_DATA, _DATA_LOCATION = 13, 14  # TensorProto


def fault(model: bytes) -> str | None:
    """Why a model file must not be opened, or None where it is plain arithmetic on its own numbers."""
    try:
        for field, value in _fields(memoryview(model)):
            if field in (_TRAINING, _FUNCTIONS):
                return "it holds functions or training steps"
            if field == _GRAPH and isinstance(value, memoryview) and (found := _graph_fault(value)):
                return found
    except ValueError:
        return "it is no ONNX file or cut off"
    return None


def versions(model: bytes) -> tuple[int, int]:
    """(operator set, IR version) in which a model says it is written; 0 for what it does not say."""
    opset = ir_version = 0
    # What is malformed is for fault to say.
    with contextlib.suppress(ValueError):
        for field, value in _fields(memoryview(model)):
            if field == _IR_VERSION and isinstance(value, int):
                ir_version = value
            elif field == _OPSET and isinstance(value, memoryview):
                numbers = (n for part, n in _fields(value) if part == _VERSION and isinstance(n, int))
                opset = max(opset, *numbers, 0)
    return opset, ir_version


def _graph_fault(graph: memoryview) -> str | None:
    for field, value in _fields(graph):
        if field == _SPARSE_INITIALIZER:
            return "it holds sparse tensors"
        if isinstance(value, memoryview):
            check = {_NODE: _node_fault, _INITIALIZER: _tensor_fault}.get(field)
            if check is not None and (found := check(value)):
                return found
    return None


def _node_fault(node: memoryview) -> str | None:
    operation = domain = ""
    for field, value in _fields(node):
        if not isinstance(value, memoryview):
            continue
        if field == _OPERATION:
            operation = bytes(value).decode(errors="replace")
        elif field == _DOMAIN:
            domain = bytes(value).decode(errors="replace")
        elif field == _ATTRIBUTE:
            for part, content in _fields(value):
                if part in _SUBGRAPHS:
                    return "it holds subgraphs"
                if part in (_TENSOR, _TENSORS) and isinstance(content, memoryview):
                    found = _tensor_fault(content)
                    if found:
                        return found
    if domain or operation not in OPERATIONS:
        return f"it uses the operation {f'{domain}.{operation}'.lstrip('.')!r}"
    return None


def _tensor_fault(tensor: memoryview) -> str | None:
    for field, value in _fields(tensor):
        if field == _EXTERNAL_DATA or (field == _DATA_LOCATION and value):
            return "its numbers lie in another file"
    return None


def _fields(message: memoryview) -> Iterator[tuple[int, int | memoryview | None]]:
    """(number, value) of a protobuf message's fields; None for fixed-width numbers. ValueError: malformed."""
    at = 0
    while at < len(message):
        value: int | memoryview | None = None
        key, at = _varint(message, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(message, at)
        elif kind == 1:
            at += 8
        elif kind == 2:
            size, at = _varint(message, at)
            value = message[at : at + size]
            at += size
        elif kind == 5:
            at += 4
        else:
            raise ValueError(f"wire type {kind}")
        # A tag has 32 bits; readers that cut a longer one would see another field than this one does.
        if at > len(message) or key >> 32:
            raise ValueError("cut off")
        yield key >> 3, value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            break
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("cut off")

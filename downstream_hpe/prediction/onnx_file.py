# SPDX-License-Identifier: MIT
"""The ONNX file of a model: its form, and what it may hold before onnxruntime is let near it.

A file of `downstream-hpe export` is arithmetic on tensors that lie in the file. ONNX allows more: tensors
in other files, which onnxruntime before 1.25 reads from anywhere, subgraphs, and graphs whose tensors fill
the memory. Nothing of that is needed here, so it is refused.
"""

from __future__ import annotations

import contextlib
import struct

from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.prediction import onnx_wire as wire
from downstream_hpe.prediction.onnx_shapes import MAX_NODES, RULES, Sizes, Unfit
from downstream_hpe.prediction.onnx_wire import Node, Tensor

FORMAT = "downstream-hpe 1"
"""Said in the metadata of every file."""
SHAPES = {"landmarks": [POINTS, 3], "ypr_deg": [3], "rotation": [3, 3], "confidence": []}
"""The graph's input and outputs, after the first axis; confidence may be missing."""
MAX_BYTES = 64_000_000
OPSET, IR_VERSION = 17, 8
"""Versions of ONNX's operators and of its format in which models are exported."""


def fault(model: bytes) -> str | None:
    """Why a model file must not be opened, or None where it is plain arithmetic on its own numbers, of a
    size that :mod:`downstream_hpe.prediction.onnx_shapes` states."""
    graphs = []
    try:
        for field, value in wire.fields(memoryview(model)):
            if field in (wire.TRAINING, wire.FUNCTIONS):
                return "it holds functions or training steps"
            if field == wire.GRAPH and isinstance(value, memoryview):
                graphs.append(value)
        if len(graphs) > 1:
            return "it holds several graphs"
        return _graph_fault(graphs[0]) if graphs else None
    except Unfit as error:
        return str(error)
    except KeyError:
        return "a node takes what there is not"
    except (ValueError, IndexError, TypeError, struct.error):
        return "it is no ONNX file or cut off"


def versions(model: bytes) -> tuple[int, int]:
    """(operator set, IR version) in which a model says it is written; 0 for what it does not say."""
    opset = ir_version = 0
    # What is malformed is for fault to say.
    with contextlib.suppress(ValueError):
        for field, value in wire.fields(memoryview(model)):
            if field == wire.IR_VERSION and isinstance(value, int):
                ir_version = value
            elif field == wire.OPSET and isinstance(value, memoryview):
                numbers = (n for part, n in wire.fields(value) if part == wire.VERSION and isinstance(n, int))
                opset = max(opset, *numbers, 0)
    return opset, ir_version


def _graph_fault(graph: memoryview) -> str | None:
    nodes: list[Node] = []
    constants: list[Tensor] = []
    inputs: dict[str, tuple[int | None, ...] | None] = {}
    for field, value in wire.fields(graph):
        if field == wire.SPARSE_INITIALIZER:
            return "it holds sparse tensors"
        if not isinstance(value, memoryview):
            continue
        if field == wire.NODE:
            nodes.append(wire.read_node(value))
        elif field == wire.INITIALIZER:
            constants.append(wire.read_tensor(value))
        elif field == wire.INPUT:
            name, shape = wire.read_input(value)
            inputs[name] = shape
        if len(nodes) > MAX_NODES or len(constants) > MAX_NODES:
            return f"it has more than {MAX_NODES} nodes"
    if any(tensor.external for tensor in (*constants, *(t for node in nodes for t in node.tensors))):
        return "its numbers lie in another file"
    for node in nodes:
        if node.subgraphs:
            return "it holds subgraphs"
        if node.domain or (node.operation not in RULES and node.operation != "Constant"):
            return f"it uses the operation {f'{node.domain}.{node.operation}'.lstrip('.')[:60]!r}"
    named = {tensor.name for tensor in constants}
    sizes = Sizes(constants, {name: shape for name, shape in inputs.items() if name not in named})
    for node in nodes:
        sizes.add(node)
    return None

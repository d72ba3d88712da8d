# SPDX-License-Identifier: MIT
"""Protobuf as an ONNX file holds it: fields by their number, and what is needed of nodes and tensors.

A field that stands once is taken from nowhere else: readers differ in whether the last one counts or all
are merged, so a second one is malformed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

Value = int | bytes | memoryview

# Field numbers of onnx.proto, by message.
IR_VERSION, GRAPH, OPSET = 1, 7, 8  # ModelProto
TRAINING, FUNCTIONS = 20, 25
VERSION = 2  # OperatorSetIdProto
NODE, INITIALIZER, INPUT, SPARSE_INITIALIZER = 1, 5, 11, 15  # GraphProto
_INPUTS, _OUTPUTS, _OPERATION, _ATTRIBUTES, _DOMAIN = 1, 2, 4, 5, 7  # NodeProto
_INTEGER, _TENSOR, _INTEGERS, _TENSORS = 3, 5, 8, 10  # AttributeProto; 1 is the name of most messages
SUBGRAPHS = {6, 11, 22, 23}  # graphs and sparse tensors
_DIMS, _TYPE, _INT32, _INT64, _NAME, _RAW = 1, 2, 5, 7, 8, 9  # TensorProto
_EXTERNAL_DATA, _DATA_LOCATION = 13, 14

_INT64_TYPE, _INT32_TYPE = 7, 6
MAX_NUMBERS = 4096
"""Of an attribute or a tensor of sizes; larger tensors are not taken apart."""


@dataclass
class Tensor:
    """stored: bytes of the whole message. external: its numbers lie in
    another file. numbers: of a short tensor of whole numbers, else None."""

    name: str = ""
    dims: tuple[int, ...] = ()
    stored: int = 0
    external: bool = False
    numbers: tuple[int, ...] | None = None


@dataclass
class Node:
    """attributes: whole numbers, lists of them, and tensors, by name. subgraphs: it holds some."""

    operation: str = ""
    domain: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    attributes: dict[str, int | tuple[int, ...] | Tensor] = field(default_factory=dict)
    tensors: list[Tensor] = field(default_factory=list)
    subgraphs: bool = False


def fields(message: memoryview) -> Iterator[tuple[int, int | memoryview | None]]:
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


def read_node(message: memoryview) -> Node:
    """A NodeProto. ValueError: malformed."""
    node = Node()
    seen: set[int] = set()
    for number, value in fields(message):
        if not isinstance(value, memoryview):
            continue
        if number == _INPUTS:
            node.inputs.append(_text(value))
        elif number == _OUTPUTS:
            node.outputs.append(_text(value))
        elif number in (_OPERATION, _DOMAIN):
            _once(seen, number)
            if number == _OPERATION:
                node.operation = _text(value)
            else:
                node.domain = _text(value)
        elif number == _ATTRIBUTES:
            _read_attribute(value, node)
    return node


def _read_attribute(message: memoryview, node: Node) -> None:
    name, numbers = "", []
    found: int | Tensor | None = None
    seen: set[int] = set()
    for number, value in fields(message):
        if number in SUBGRAPHS:
            node.subgraphs = True
        elif number == 1 and isinstance(value, memoryview):
            _once(seen, number)
            name = _text(value)
        elif number == _INTEGER and isinstance(value, int):
            _once(seen, number)
            found = _signed(value)
        elif number == _INTEGERS:
            numbers += _integers(value)
        elif number in (_TENSOR, _TENSORS) and isinstance(value, memoryview):
            if number == _TENSOR:
                _once(seen, number)
            tensor = read_tensor(value)
            node.tensors.append(tensor)
            found = tensor
    if name in node.attributes:
        raise ValueError("an attribute is there twice")
    if len(numbers) > MAX_NUMBERS or (numbers and found is not None):
        raise ValueError("an attribute is of two kinds, or too long")
    if numbers or found is not None:
        node.attributes[name] = tuple(numbers) if found is None else found


def read_tensor(message: memoryview) -> Tensor:
    """A TensorProto. ValueError: malformed."""
    tensor = Tensor(stored=len(message))
    dims: list[int] = []
    plain: list[int] = []
    raw: memoryview | None = None
    kind = 0
    seen: set[int] = set()
    for number, value in fields(message):
        if number == _EXTERNAL_DATA or (number == _DATA_LOCATION and value):
            tensor.external = True
        elif number == _DIMS:
            dims += _integers(value)
        elif number == _TYPE and isinstance(value, int):
            _once(seen, number)
            kind = value
        elif number in (_INT32, _INT64) and len(plain) <= MAX_NUMBERS:
            plain += _integers(value)
        elif number == _NAME and isinstance(value, memoryview):
            _once(seen, number)
            tensor.name = _text(value)
        elif number == _RAW and isinstance(value, memoryview):
            _once(seen, number)
            raw = value
    if len(dims) > MAX_NUMBERS:
        raise ValueError("too many axes")
    tensor.dims = tuple(dims)
    if kind in (_INT64_TYPE, _INT32_TYPE):
        if raw is not None and len(raw) <= 8 * MAX_NUMBERS:
            letter, width = ("q", 8) if kind == _INT64_TYPE else ("i", 4)
            plain = list(struct.unpack(f"<{len(raw) // width}{letter}", raw[: len(raw) // width * width]))
        tensor.numbers = tuple(plain) if len(plain) <= MAX_NUMBERS else None
    return tensor


def read_input(message: memoryview) -> tuple[str, tuple[int | None, ...] | None]:
    """Name and shape of a ValueInfoProto; None for a size, or a shape, that it does not say."""
    name, shape = "", None
    for number, value in fields(message):
        if number == 1 and isinstance(value, memoryview):
            name = _text(value)
        elif number == 2 and isinstance(value, memoryview):
            for kind, tensor in fields(value):
                if kind == 1 and isinstance(tensor, memoryview):
                    for part, dims in fields(tensor):
                        if part == 2 and isinstance(dims, memoryview):
                            shape = _sizes(dims)
    return name, shape


def _sizes(message: memoryview) -> tuple[int | None, ...]:
    sizes: list[int | None] = []
    for number, dim in fields(message):
        if number == 1 and isinstance(dim, memoryview):
            said = [value for part, value in fields(dim) if part == 1 and isinstance(value, int)]
            sizes.append(_signed(said[-1]) if said else None)
    return tuple(sizes)


def _integers(value: int | memoryview | None) -> list[int]:
    """Of a repeated field: one a field, or packed."""
    if isinstance(value, int):
        return [_signed(value)]
    numbers: list[int] = []
    at = 0
    while isinstance(value, memoryview) and at < len(value) and len(numbers) <= MAX_NUMBERS:
        number, at = _varint(value, at)
        numbers.append(_signed(number))
    return numbers


def _signed(value: int) -> int:
    return value - (1 << 64) if value >= 1 << 63 else value


def _text(value: memoryview) -> str:
    return bytes(value).decode(errors="replace")


def _once(seen: set[int], number: int) -> None:
    if number in seen:
        raise ValueError("a field is there twice")
    seen.add(number)


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            break
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & ((1 << 64) - 1), at
    raise ValueError("cut off")

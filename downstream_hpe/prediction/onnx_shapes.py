# SPDX-License-Identifier: MIT
"""How large everything in a graph becomes, before onnxruntime makes it: three Concat of a hundred copies
each take 4 GB.

A shape rule an operation; what has none is refused. Sizes that a graph computes for itself are, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod

from downstream_hpe.prediction.onnx_wire import Node, Tensor

Shape = tuple[int, ...]
BATCH = 1024
"""So many faces at once at most: a graph may hold the square of their number."""
MAX_NUMBERS = 1 << 26
"""In all tensors that a graph makes of a batch; one of `downstream-hpe export` makes a fifth."""
MAX_PRODUCTS = 1 << 36
"""Of all its matrices; of such a one, a hundredth."""
MAX_NODES = 2000
MAX_AXES = 8
_TEXT = 8  # TensorProto.STRING


class Unfit(ValueError):
    """A graph is refused; the text says why."""


class Sizes:
    """The shape of every tensor of a graph, node by node."""

    def __init__(self, constants: Sequence[Tensor], inputs: dict[str, tuple[int | None, ...] | None]) -> None:
        self.shapes: dict[str, Shape] = {}
        self.numbers: dict[str, tuple[int, ...]] = {}
        self._made = self._products = 0
        for name, said in inputs.items():
            if said is not None:
                self._add(name, tuple(BATCH if size is None else size for size in said))
        for tensor in constants:
            self._constant(tensor.name, tensor)

    def add(self, node: Node) -> None:
        """Raises :class:`Unfit`: the node makes too much, or what cannot be said."""
        if node.operation == "Constant":
            if len(node.tensors) != 1:
                raise Unfit("a constant is no tensor")
            self._constant(node.outputs[0], node.tensors[0])
            return
        if node.operation == "Cast" and node.attributes.get("to") == _TEXT:
            raise Unfit("it makes text")
        rule = RULES[node.operation]
        known = [self.shapes[name] if name else () for name in node.inputs]
        for name, shape in zip(node.outputs, rule(self, node, known), strict=False):
            if name:
                self._add(name, shape)
        if any(name and name not in self.shapes for name in node.outputs):
            raise Unfit("it has outputs of unknown size")

    def attribute(self, node: Node, name: str, default: int) -> int:
        """A whole number of a node."""
        value = node.attributes.get(name, default)
        return value if isinstance(value, int) else default

    def listed(self, node: Node, name: str, place: int) -> tuple[int, ...] | None:
        """Whole numbers of a node: an attribute, or a constant among its inputs; None where it has none."""
        value = node.attributes.get(name)
        if isinstance(value, tuple):
            return value
        if place < len(node.inputs) and node.inputs[place]:
            if node.inputs[place] not in self.numbers:
                raise Unfit("it computes sizes")
            return self.numbers[node.inputs[place]]
        return None

    def multiply(self, count: int) -> None:
        """Count products of numbers. Raises Unfit: too many."""
        self._products += count
        if self._products > MAX_PRODUCTS:
            raise Unfit("its matrices take too long")

    def _constant(self, name: str, tensor: Tensor) -> None:
        # Whatever its kind, a number is at least a byte, or half of one.
        if prod(tensor.dims) > 2 * tensor.stored:
            raise Unfit("a tensor holds less than it says")
        self._add(name, tensor.dims)
        if tensor.numbers is not None:
            self.numbers[name] = tensor.numbers

    def _add(self, name: str, shape: Shape) -> None:
        if len(shape) > MAX_AXES or min(shape, default=0) < 0:
            raise Unfit("a tensor has a shape that none can have")
        if name in self.shapes:
            raise Unfit("a name stands for two tensors")
        self._made += prod(shape)
        if self._made > MAX_NUMBERS:
            raise Unfit(f"it makes more than {MAX_NUMBERS:,} numbers of {BATCH} faces")
        self.shapes[name] = shape


Rule = Callable[[Sizes, Node, list[Shape]], list[Shape]]


def _same(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    return [known[0]] * len(node.outputs)


def _broadcast(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    return [_common(known)]


def _common(shapes: Sequence[Shape]) -> Shape:
    """numpy's broadcasting."""
    length = max(map(len, shapes))
    result = []
    for column in zip(*((1,) * (length - len(shape)) + shape for shape in shapes), strict=True):
        sizes = set(column) - {1}
        if len(sizes) > 1:
            raise Unfit("its sizes do not fit together")
        result.append(sizes.pop() if sizes else 1)
    return tuple(result)


def _quantized(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    return [known[0], (), ()]


def _matmul(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    left, right = known[:2]
    rows = left if len(left) > 1 else (1, *left)
    columns = right if len(right) > 1 else (*right, 1)
    if rows[-1] != columns[-2]:
        raise Unfit("its sizes do not fit together")
    result = (*_common([rows[:-2], columns[:-2]]), rows[-2], columns[-1])
    sizes.multiply(prod(result) * rows[-1])
    return [result]


def _gemm(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    left, right = known[:2]
    left = left[::-1] if sizes.attribute(node, "transA", 0) else left
    right = right[::-1] if sizes.attribute(node, "transB", 0) else right
    if len(left) != 2 or len(right) != 2 or left[1] != right[0]:
        raise Unfit("its sizes do not fit together")
    sizes.multiply(left[0] * left[1] * right[1])
    return [(left[0], right[1])]


def _axis(axis: int, rank: int) -> int:
    if not -rank <= axis < rank:
        raise Unfit("an axis is none")
    return axis % rank


def _concat(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    axis = _axis(sizes.attribute(node, "axis", 0), len(known[0]))
    if len({(len(shape), shape[:axis], shape[axis + 1 :]) for shape in known}) > 1:
        raise Unfit("its sizes do not fit together")
    return [(*known[0][:axis], sum(shape[axis] for shape in known), *known[0][axis + 1 :])]


def _gather(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    axis = _axis(sizes.attribute(node, "axis", 0), len(known[0]))
    return [(*known[0][:axis], *known[1], *known[0][axis + 1 :])]


def _reshape(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    wanted = sizes.listed(node, "shape", 1)
    if wanted is None or sizes.attribute(node, "allowzero", 0):
        raise Unfit("it computes sizes")
    shape = [known[0][k] if size == 0 else size for k, size in enumerate(wanted)]
    whole, given = prod(known[0]), prod(size for size in shape if size != -1)
    # Where it does not divide, onnxruntime will say so of the faces that it gets.
    shape = [-(-whole // max(given, 1)) if size == -1 else size for size in shape]
    if wanted.count(-1) > 1 or (-1 not in wanted and given != whole):
        raise Unfit("its sizes do not fit together")
    return [tuple(shape)]


def _reduce(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    rank = len(known[0])
    axes = sizes.listed(node, "axes", 1)
    gone = {_axis(axis, rank) for axis in axes} if axes else set(range(rank))
    if sizes.attribute(node, "keepdims", 1):
        return [tuple(1 if k in gone else size for k, size in enumerate(known[0]))]
    return [tuple(size for k, size in enumerate(known[0]) if k not in gone)]


def _flatten(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    axis = sizes.attribute(node, "axis", 1)
    axis = axis if axis == len(known[0]) else _axis(axis, len(known[0]))
    return [(prod(known[0][:axis]), prod(known[0][axis:]))]


def _transpose(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    order = node.attributes.get("perm", tuple(range(len(known[0])))[::-1])
    if not isinstance(order, tuple) or sorted(order) != list(range(len(known[0]))):
        raise Unfit("an axis is none")
    return [tuple(known[0][k] for k in order)]


def _squeeze(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    axes = sizes.listed(node, "axes", 1)
    gone = {_axis(a, len(known[0])) for a in axes} if axes else {k for k, s in enumerate(known[0]) if s == 1}
    if any(known[0][k] != 1 for k in gone):
        raise Unfit("its sizes do not fit together")
    return [tuple(size for k, size in enumerate(known[0]) if k not in gone)]


def _unsqueeze(sizes: Sizes, node: Node, known: list[Shape]) -> list[Shape]:
    axes = sizes.listed(node, "axes", 1) or ()
    rank = len(known[0]) + len(axes)
    new, rest = {_axis(axis, rank) for axis in axes}, iter(known[0])
    if len(new) != len(axes):
        raise Unfit("an axis is none")
    return [tuple(1 if k in new else next(rest) for k in range(rank))]


_SAME = """
    Abs Acos Asin Atan Cast Clip Cos DequantizeLinear Elu Erf Exp Floor Gelu Identity IsNaN LayerNormalization
    LeakyRelu Log Neg Not QuantizeLinear Reciprocal Relu Selu Sigmoid Sign Sin Softmax Softplus Sqrt Tan Tanh
"""
_BROADCAST = "Add And Div Equal Greater GreaterOrEqual Less LessOrEqual Max Min Mul Or PRelu Pow Sub Where"
_REDUCE = "ReduceL2 ReduceMax ReduceMean ReduceMin ReduceSum ReduceSumSquare"
RULES: dict[str, Rule] = {
    **dict.fromkeys(_SAME.split(), _same),
    **dict.fromkeys(_BROADCAST.split(), _broadcast),
    **dict.fromkeys(_REDUCE.split(), _reduce),
    "Concat": _concat,
    "DynamicQuantizeLinear": _quantized,
    "Flatten": _flatten,
    "Gather": _gather,
    "Gemm": _gemm,
    "MatMul": _matmul,
    "MatMulInteger": _matmul,
    "Reshape": _reshape,
    "Squeeze": _squeeze,
    "Transpose": _transpose,
    "Unsqueeze": _unsqueeze,
}
"""What a graph may use, besides Constant."""

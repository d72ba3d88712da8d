# SPDX-License-Identifier: MIT
"""The Tucker model of the pose tensor and its streamed fit where no cell is missing.

    T = W x1 A^(id) x2 A^(y) x3 A^(p) x4 A^(r),    W = G x5 A^(f)

The feature mode is kept whole, so W [Ri, Ry, Rp, Rr, F] is all that is needed of G and A^(f).
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from downstream_hpe.manifold.rowspace import RowSpace, leading
from downstream_hpe.manifold.slabs import Slabs

S = TypeVar("S")
T = TypeVar("T")
Ranks = tuple[int, int, int, int]

KEPT_BYTES = 256e6
"""A contracted tensor up to this size is kept between passes."""

THREADS = min(4, os.cpu_count() or 1)
"""Heads worked on at once; as many again wait in memory."""


@dataclass(frozen=True)
class Decomposition:
    """Factors of the pose tensor. Every factor has orthonormal columns, strongest first.

    core            W, float64 [Ri, Ry, Rp, Rr, F]
    identity        float64 [N, Ri]; yaw [Dy, Ry]; pitch [Dp, Rp]; roll [Dr, Rr]
    energies        a mode (identity, yaw, pitch, roll): squared singular values over |T|^2. Modes
                    are truncated one after the other (yaw, pitch, roll, identity), so those of a
                    mode are of the tensor that the modes before it left.
    relative_error  |T - T^| / |T| over the observed cells
    passes          how often the tensor was read
    """

    core: np.ndarray
    identity: np.ndarray
    yaw: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    energies: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    relative_error: float
    passes: int

    @property
    def poses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three pose factors: yaw, pitch, roll."""
        return self.yaw, self.pitch, self.roll

    def slab(self, head: int) -> np.ndarray:
        """The fit of one head: float64 [Dy, Dp, Dr, F]."""
        return expand(np.tensordot(self.identity[head], self.core, 1), self.poses)

    def cells(self, head: int, chosen: np.ndarray) -> np.ndarray:
        """The fit of some cells of one head. chosen: bool [Dy, Dp, Dr]; float64 [cells, F]."""
        y, p, r = (factor[i] for factor, i in zip(self.poses, np.nonzero(chosen), strict=True))
        rows = np.einsum("ni,nj,nk->nijk", y, p, r).reshape(len(y), -1)
        return rows @ np.tensordot(self.identity[head], self.core, 1).reshape(rows.shape[1], -1)


def expand(core: np.ndarray, poses: tuple[np.ndarray, ...]) -> np.ndarray:
    """core [Ry, Rp, Rr, F] x yaw x pitch x roll factors: [Dy, Dp, Dr, F]."""
    for mode, factor in enumerate(poses):
        core = _times(core, factor, mode)
    return core


class _Projected:
    """The tensor contracted with the pose factors found so far.

    Kept in memory from the pass on in which it fits the budget, so that the tables are read
    twice, not four times, for up to some hundred heads.
    """

    def __init__(self, tensor: Slabs) -> None:
        self.reads = 0
        self._tensor = tensor
        self._kept: deque[np.ndarray] | None = None
        self._factors: list[tuple[int, np.ndarray]] = []

    def contract(self, mode: int, factor: np.ndarray) -> None:
        """Contract with the transpose of a factor from now on."""
        self._factors.append((mode, factor))

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> Iterator[np.ndarray]:
        """function of each slab, in order."""
        self.reads += self._kept is None
        kept = self._kept
        # Let go one by one: fresh memory is slow, and what is kept next takes theirs.
        source = self._tensor.slabs() if kept is None else (kept.popleft() for _ in range(len(kept)))
        factors = self._factors
        keep: deque[np.ndarray] = deque()
        fits = True

        def work(slab: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            for mode, factor in factors:
                slab = _times(slab, factor.T, mode)
            return slab, function(slab)

        for slab, value in _in_threads(work, source):
            fits = fits and slab.nbytes * self._tensor.shape[0] <= KEPT_BYTES
            if fits:
                keep.append(slab)
            yield value
        if fits:
            self._kept, self._factors = keep, []


def _in_threads(function: Callable[[S], T], items: Iterable[S]) -> Iterator[T]:
    """function of each item, in order whatever the threads do, so that sums have the same bits."""
    pending: deque[Future[T]] = deque()
    with ThreadPoolExecutor(THREADS) as pool:
        for item in items:
            pending.append(pool.submit(function, item))
            if len(pending) > 2 * THREADS:
                yield pending.popleft().result()
        for future in pending:
            yield future.result()


def sequential(tensor: Slabs, ranks: Ranks) -> Decomposition:
    """Sequentially truncated higher-order SVD, one streaming pass a mode; every cell is read."""
    projected = _Projected(tensor)
    poses: list[np.ndarray] = []
    energies = []
    total = lost = 0.0
    for mode in range(3):
        gram = np.zeros((tensor.shape[mode + 1],) * 2)
        for part in projected.map(partial(_gram, mode=mode)):
            gram += part
        values, vectors = leading(gram, ranks[mode + 1])
        # The first trace is |T|^2: nothing has been truncated yet.
        total = total or float(np.trace(gram))
        lost += float(values[ranks[mode + 1] :].sum())
        poses.append(vectors)
        energies.append(values / total)
        projected.contract(mode, vectors)
    rows = RowSpace()
    for row in projected.map(np.ravel):
        rows.add(row)
    left, singular, right = rows.finish(ranks[0])
    core = (singular[: ranks[0], None] * right).reshape(*ranks, tensor.shape[4])
    error = np.sqrt((lost + rows.dropped) / total)
    every = (singular**2 / total, *energies)
    return _with_signs(core, left, poses, every, error, projected.reads)


def refine(tensor: Slabs, fit: Decomposition, rounds: int) -> Decomposition:
    """Rounds of higher-order orthogonal iteration, two passes each; every cell is read."""
    for _ in range(rounds):
        # Contracted with A^(id), the tensor has a size that no longer depends on N.
        seen = np.zeros((fit.identity.shape[1], *tensor.shape[1:]))
        total = 0.0
        for weights, slab in zip(fit.identity, tensor.slabs(), strict=True):
            seen += np.multiply.outer(weights, slab)
            total += float(np.vdot(slab, slab))
        poses = list(fit.poses)
        for mode in range(3):
            others = [np.eye(len(f)) if k == mode else f for k, f in enumerate(poses)]
            gram = np.sum([_gram(_project(part, others), mode) for part in seen], axis=0)
            _, poses[mode] = leading(gram, poses[mode].shape[1])
        rows = RowSpace()
        for slab in tensor.slabs():
            rows.add(_project(slab, poses).ravel())
        rank = fit.identity.shape[1]
        left, singular, right = rows.finish(rank)
        core = (singular[:rank, None] * right).reshape(fit.core.shape)
        error = np.sqrt(max(1.0 - float((singular[:rank] ** 2).sum()) / total, 0.0))
        fit = _with_signs(core, left, poses, fit.energies, error, fit.passes + 2)
    return fit


def _times(x: np.ndarray, matrix: np.ndarray, mode: int) -> np.ndarray:
    """x contracted along one axis with matrix [R, D]: the axis becomes R long."""
    return np.moveaxis(matrix.astype(x.dtype, copy=False) @ np.moveaxis(x, mode, -2), -2, mode)


def _project(slab: np.ndarray, poses: list[np.ndarray]) -> np.ndarray:
    """slab [Dy, Dp, Dr, F] contracted with the transposes of the first pose factors."""
    for mode, factor in enumerate(poses):
        slab = _times(slab, factor.T, mode)
    return slab


def _gram(slab: np.ndarray, mode: int) -> np.ndarray:
    """X X^T of the unfolding of slab [Dy, Dp, Dr, F] along one pose axis: float64 [D, D].

    Products over F alone, summed in float64: single precision is not left to add up, and BLAS does
    such small ones in the thread that calls it.
    """
    x = np.moveaxis(slab, mode, -2)
    return (x @ np.swapaxes(x, -1, -2)).sum(axis=(0, 1), dtype=np.float64)


def _with_signs(
    core: np.ndarray,
    identity: np.ndarray,
    poses: list[np.ndarray],
    energies: tuple[np.ndarray, ...],
    error: float,
    passes: int,
) -> Decomposition:
    """Columns turned so that sum_i (i + 1) a_i > 0, which even and odd curves both decide."""
    factors = []
    for mode, factor in enumerate((identity, *poses)):
        weights = np.arange(1, len(factor) + 1)
        signs = np.where(weights @ factor < 0, -1.0, 1.0)
        factors.append(np.asarray(factor * signs, dtype=np.float64))
        core = core * signs.reshape([-1 if k == mode else 1 for k in range(5)])
    left, yaw, pitch, roll = factors
    kept = (energies[0], energies[1], energies[2], energies[3])
    return Decomposition(
        np.asarray(core, dtype=np.float64), left, yaw, pitch, roll, kept, float(error), passes
    )

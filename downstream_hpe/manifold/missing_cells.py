# SPDX-License-Identifier: MIT
"""Tucker decomposition with missing cells: expectation-maximisation over whole cells."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.manifold.slabs import ArrayTensor, SlabsWithGaps
from downstream_hpe.manifold.tucker import Decomposition, Ranks, refine, sequential


@dataclass(frozen=True)
class _Filled:
    """A tensor whose missing cells are those of a guess(head, missing): [cells, F]."""

    tensor: SlabsWithGaps
    guess: Callable[[int, np.ndarray], np.ndarray]

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        return self.tensor.shape

    def slabs(self) -> Iterator[np.ndarray]:
        for head, (slab, seen) in enumerate(zip(self.tensor.slabs(), self.tensor.observed, strict=True)):
            if not seen.all():
                slab = slab.copy()
                slab[~seen] = self.guess(head, ~seen)
            yield slab


def fill_and_fit(
    tensor: SlabsWithGaps,
    ranks: Ranks,
    refinements: int,
    tolerance: float,
    max_rounds: int,
    progress: Callable[[int, float], None] | None,
) -> Decomposition:
    """Fill, decompose, fill again, until the fit of the observed cells rests.

    progress: called with (round, relative error on the observed cells).
    Raises DataError where it does not converge in max_rounds.
    """
    mean = _mean_head(tensor, ranks, tolerance, max_rounds)
    fit = sequential(_Filled(tensor, lambda head, empty: mean[empty]), ranks)
    passes = 1 + fit.passes
    before = np.inf
    for done in range(1, max_rounds + 1):
        current = fit
        filled = _Filled(tensor, current.cells)
        fit = refine(filled, sequential(filled, ranks), refinements)
        error = _observed_error(tensor, fit)
        passes += fit.passes + 1
        if progress is not None:
            progress(done, error)
        if before - error < tolerance:
            return replace(fit, relative_error=error, passes=passes)
        before = error
    raise DataError(
        f"missing cells did not converge in {max_rounds} rounds (relative error {error:.3g}); "
        "fill more of them, lower the ranks or raise the tolerance"
    )


def _mean_head(tensor: SlabsWithGaps, ranks: Ranks, tolerance: float, max_rounds: int) -> np.ndarray:
    """The mean over heads, a start for missing cells: float64 [Dy, Dp, Dr, F].

    Where no head has a cell, the mean is completed by the same method, as a tensor of one head.
    """
    total = np.zeros(tensor.shape[1:])
    for slab, seen in zip(tensor.slabs(), tensor.observed, strict=True):
        total += np.where(seen[..., None], slab, 0.0)
    count = tensor.observed.sum(axis=0)
    known = count > 0
    mean = total / np.maximum(count, 1)[..., None]
    if known.all():
        return mean
    if tensor.shape[0] == 1:
        mean[~known] = mean[known].mean(axis=0)
        return mean
    mean[~known] = np.nan
    alone = ArrayTensor(mean[None], known[None])
    fit = fill_and_fit(alone, (1, *ranks[1:]), 0, tolerance, max_rounds, None)
    return np.where(known[..., None], mean, fit.slab(0))


def _observed_error(tensor: SlabsWithGaps, fit: Decomposition) -> float:
    lost = total = 0.0
    for head, (slab, seen) in enumerate(zip(tensor.slabs(), tensor.observed, strict=True)):
        known = slab[seen]
        difference = known - fit.cells(head, seen)
        lost += float(np.vdot(difference, difference))
        total += float(np.vdot(known, known))
    return float(np.sqrt(lost / total))

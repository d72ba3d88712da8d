# SPDX-License-Identifier: MIT
"""Tucker decomposition of the pose tensor, with or without missing cells, streamed head by head."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.manifold.missing_cells import fill_and_fit
from downstream_hpe.manifold.slabs import SlabsWithGaps
from downstream_hpe.manifold.tucker import Decomposition, Ranks, refine, sequential

__all__ = ["PAPER_RANKS", "Decomposition", "Ranks", "decompose"]

PAPER_RANKS: Ranks = (5, 3, 3, 3)
"""Of identity, yaw, pitch and roll."""

MODES = ("identity", *ANGLES)


def decompose(
    tensor: SlabsWithGaps,
    ranks: Ranks = PAPER_RANKS,
    *,
    refinements: int = 0,
    tolerance: float = 1e-5,
    max_rounds: int = 200,
    progress: Callable[[int, float], None] | None = None,
) -> Decomposition:
    """Sequentially truncated higher-order SVD, one streaming pass a mode.

    The factor of a mode is spanned by the leading eigenvectors of its Gram matrix, summed over
    heads (Vannieuwenhoven et al., SIAM J. Sci. Comput. 34(2), 2012, Alg. 1); the identity mode
    comes last, from the rows that are left (:mod:`downstream_hpe.manifold.rowspace`). Memory does not
    depend on the number of heads, but for the factor A^(id) itself.

    With cells missing, expectation-maximisation: fill them with the current fit, decompose again,
    until the fit of the observed cells rests. Cells that no head has are predicted from the
    multilinear structure alone.

    Parameters
    ----------
    tensor: read several times, in the same order.
    ranks: of identity, yaw, pitch, roll.
    refinements: rounds of higher-order orthogonal iteration after it (De Lathauwer et al., SIAM J.
        Matrix Anal. 21(4), 2000); none raises the error. Two passes a round.
    tolerance: of missing cells: stop when a round changes the fit of the observed cells by less
        than this share of |T|.
    max_rounds: of missing cells.
    progress: called with (round, relative error) when cells are missing.

    Raises
    ------
    DataError: a mode smaller than its rank, no cell at all for some head or angle, or missing
        cells that did not converge.
    """
    _check(tensor, ranks)
    if tensor.observed.all():
        return refine(tensor, sequential(tensor, ranks), refinements)
    return fill_and_fit(tensor, ranks, refinements, tolerance, max_rounds, progress)


def _check(tensor: SlabsWithGaps, ranks: Ranks) -> None:
    for mode, (name, size, rank) in enumerate(zip(MODES, tensor.shape, ranks, strict=False)):
        if not 1 <= rank <= size:
            what = "heads" if mode == 0 else f"{name} angles on the grid"
            raise DataError(f"{size} {what}, too few for rank {rank}; expected at least {rank}")
        seen = tensor.observed.any(axis=tuple(k for k in range(4) if k != mode))
        if not seen.all():
            raise DataError(f"no landmarks at all for {name} number {int(np.argmin(seen))}; leave it out")

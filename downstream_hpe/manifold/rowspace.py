# SPDX-License-Identifier: MIT
"""Leading vectors from Gram matrices, also of a matrix whose rows arrive one by one."""

from __future__ import annotations

import numpy as np


def leading(gram: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """All eigenvalues, largest first and never negative, and the leading eigenvectors [D, rank]."""
    values, vectors = np.linalg.eigh(gram)
    # A copy, because numpy multiplies by a reversed view without BLAS.
    return np.maximum(values[::-1], 0.0), vectors[:, ::-1][:, :rank].copy()


class RowSpace:
    """SVD of a matrix [N, M] with M >> N, in memory that does not grow with M times N.

    Rows are gathered in blocks; when a block is full, it is merged into the leading right
    singular vectors kept so far (Brand, Linear Algebra Appl. 415(1), 2006, with a block of
    rows for an update). Exact below `keep` + `block` rows; from there on, what is dropped is the
    energy past the first `keep` components.

    keep: right singular vectors kept. block: rows gathered before a merge.
    """

    def __init__(self, keep: int = 128, block: int = 128) -> None:
        self._keep, self._block = keep, block
        self._rows: list[np.ndarray] = []
        self._left = np.zeros((0, 0))
        self._scaled: np.ndarray | None = None  # diag(s) V^T, [k, M]
        self.dropped = 0.0
        """Energy of the components left out."""

    def add(self, row: np.ndarray) -> None:
        """One more row, float [M]."""
        self._rows.append(row)
        if len(self._rows) == self._block + (self._keep if self._scaled is None else 0):
            self._merge(self._keep)

    def finish(self, rank: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """U [N, rank], all singular values in memory (descending), V^T [rank, M]."""
        if self._scaled is None and not self._rows:
            raise ValueError("a matrix without rows has no decomposition")
        values = self._merge(rank)
        singular = np.sqrt(values)
        assert self._scaled is not None  # _merge made it
        safe = np.where(singular > 0, singular, 1.0)[:rank, None]
        return self._left, singular, self._scaled / safe

    def _merge(self, keep: int) -> np.ndarray:
        """Rotate rows onto their leading left vectors; returns all eigenvalues, descending."""
        old, count = len(self._left), len(self._rows)
        parts = [] if self._scaled is None else [self._scaled]
        stacked = np.concatenate([*parts, *(row[None] for row in self._rows)], dtype=np.float64)
        self._rows.clear()
        values, vectors = leading(stacked @ stacked.T, keep)
        self._scaled = vectors.T @ stacked
        kept = len(stacked) - count
        left = np.zeros((old + count, len(stacked)))
        left[:old, :kept] = self._left
        left[old:, kept:] = np.eye(count)
        self._left = left @ vectors
        self.dropped += float(values[keep:].sum())
        return values

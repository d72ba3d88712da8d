# SPDX-License-Identifier: MIT
"""What a decomposition reads: a tensor of heads x yaw x pitch x roll x features, head by head."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Slabs(Protocol):
    """A tensor head by head: shape (N, Dy, Dp, Dr, F); slabs(): N arrays [Dy, Dp, Dr, F], the same at every
    call."""

    @property
    def shape(self) -> tuple[int, int, int, int, int]: ...
    def slabs(self) -> Iterator[np.ndarray]: ...


class SlabsWithGaps(Slabs, Protocol):
    """What :func:`downstream_hpe.manifold.decomposition.decompose` reads: NaN where observed, bool
    [N, Dy, Dp, Dr], says that nothing was."""

    @property
    def observed(self) -> np.ndarray: ...


@dataclass(frozen=True)
class ArrayTensor:
    """A tensor in memory: values float [N, Dy, Dp, Dr, F], observed bool [N, Dy, Dp, Dr]."""

    values: np.ndarray
    observed: np.ndarray

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        return self.values.shape  # type: ignore[return-value]

    def slabs(self) -> Iterator[np.ndarray]:
        return iter(self.values)

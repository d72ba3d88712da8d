# SPDX-License-Identifier: MIT
"""What a decomposition reads: a tensor of heads x yaw x pitch x roll x features, head by head."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Slabs(Protocol):
    """What :func:`downstream_hpe.manifold.decomposition.decompose` reads.

    shape: (N, Dy, Dp, Dr, F). observed: bool [N, Dy, Dp, Dr]. slabs(): N arrays [Dy, Dp, Dr, F],
    head by head, the same at every call; NaN where not observed.
    """

    @property
    def shape(self) -> tuple[int, int, int, int, int]: ...
    @property
    def observed(self) -> np.ndarray: ...
    def slabs(self) -> Iterator[np.ndarray]: ...


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

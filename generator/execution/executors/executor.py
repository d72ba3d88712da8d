# SPDX-License-Identifier: GPL-3.0-or-later
"""One interface, several executors: orders in, outcomes out, in any order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from generator.execution.lanes.lane import OnFrame
from generator.execution.lanes.slot import Outcome
from generator.process import available_cores


class Executor(Protocol):
    """Carries out orders."""

    name: str
    workers: int

    def run(self, orders: Sequence[dict[str, Any]], on_frame: OnFrame) -> Iterator[Outcome]:
        """Yield the outcome of each order as it comes; on_frame may be called from any thread."""
        ...

    def close(self) -> None:
        """End every process that was started."""
        ...


def share_cores(workers: int) -> list[tuple[int, ...]]:
    """Cores of each worker: disjoint shares, or single cores in turn if there are more workers."""
    cores = available_cores()
    if workers >= len(cores):
        return [(cores[k % len(cores)],) for k in range(workers)]
    return [tuple(cores[k::workers]) for k in range(workers)]

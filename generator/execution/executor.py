# SPDX-License-Identifier: GPL-3.0-or-later
"""One interface, several executors: orders in, outcomes out, in any order."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from generator.execution.lane import OnFrame
from generator.execution.slot import Outcome


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


def available_cores() -> list[int]:
    """The cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def share_cores(workers: int) -> list[tuple[int, ...]]:
    """Cores of each worker: disjoint shares, or single cores in turn if there are more workers."""
    cores = available_cores()
    if workers >= len(cores):
        return [(cores[k % len(cores)],) for k in range(workers)]
    return [tuple(cores[k::workers]) for k in range(workers)]

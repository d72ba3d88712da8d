# SPDX-License-Identifier: GPL-3.0-or-later
"""One interface, several executors: orders in, outcomes out, in any order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from generator.execution.lanes.options import LaneOptions, OnImage
from generator.execution.lanes.slot import Outcome
from generator.messages import LaneOrder
from generator.process import available_cores


@dataclass(frozen=True)
class Circumstances:
    """What an executor is made from.

    scratch: an existing folder. workers: lanes; None leaves it to the executor. address: of a
    cluster, None for this machine. options: of every lane, which gets a scratch folder of its own.
    """

    scratch: Path
    workers: int | None
    address: str | None
    options: LaneOptions


class Executor(Protocol):
    """Carries out orders."""

    name: str
    workers: int

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """Yield the outcome of each order as it comes; on_image may be called from any thread."""
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

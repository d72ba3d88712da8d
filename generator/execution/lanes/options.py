# SPDX-License-Identifier: GPL-3.0-or-later
"""What a lane is to those who only start one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from generator.messages import LaneOrder, Receipt

OnImage = Callable[[], None]
"""Called after each image; from any thread."""

CPU, GPU, AUTO = DEVICES = ("cpu", "gpu", "auto")
"""What lanes render on: all on one kind of processor, since each rounds a little differently. auto is a GPU
where there is one."""

DEADLINE_S = 300.0
"""Longest wait for one sign of life. Loading a large scan and its first image take seconds."""


@dataclass(frozen=True)
class LaneOptions:
    """What a lane needs to know besides its orders.

    scratch: an existing folder of its own, best on a tmpfs. threads: of Cycles,
    0 for every core. gpu: render on a GPU, this lane on the one of its number; None: on the CPU.
    cpus: cores the lane and its render worker keep to.
    deadline_s: a render worker that is silent for so long hangs.
    memory_mib: of the lane and its render worker together; 0 for no limit.
    """

    scratch: str = ""
    blender: str | None = None
    threads: int = 0
    gpu: int | None = None
    cpus: tuple[int, ...] = ()
    deadline_s: float = DEADLINE_S
    memory_mib: float = 0.0


class AnyLane(Protocol):
    """A lane in this process or another; see :class:`generator.execution.lanes.lane.Lane`."""

    def run(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        """Carry out one order.

        Raises HeadError (this head cannot be built), WorkerError (this lane is
        broken, another may do better) or DatasetError (nothing can be written).
        """
        ...

    def close(self) -> None:
        """End it."""
        ...

    def kill(self) -> None:
        """End it now."""
        ...

# SPDX-License-Identifier: GPL-3.0-or-later
"""One lane in this process, one order after another: for tests and debugging."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from generator.execution.executors.executor import Circumstances
from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import OnImage
from generator.execution.lanes.slot import LaneSlot, Outcome
from generator.messages import LaneOrder


class SerialExecutor:
    """See :class:`generator.execution.executors.executor.Executor`."""

    name, workers = "serial", 1

    def __init__(self, given: Circumstances) -> None:
        folder = given.scratch / "lane0"
        folder.mkdir()
        self._slot = LaneSlot(lambda: Lane(replace(given.options, scratch=str(folder))))

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """See :class:`generator.execution.executors.executor.Executor`."""
        for order in orders:
            yield self._slot.run(order, on_image)

    def close(self) -> None:
        """End the render worker."""
        self._slot.close()

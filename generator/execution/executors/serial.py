# SPDX-License-Identifier: GPL-3.0-or-later
"""One lane in this process, one order after another: for tests and debugging."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from generator.execution.lanes.lane import Lane, LaneOptions, OnFrame
from generator.execution.lanes.slot import LaneSlot, Outcome


class SerialExecutor:
    """See :class:`generator.execution.executors.executor.Executor`. scratch: an existing folder."""

    name, workers = "serial", 1

    def __init__(self, scratch: Path, options: LaneOptions) -> None:
        folder = scratch / "lane0"
        folder.mkdir()
        self._slot = LaneSlot(lambda: Lane(replace(options, scratch=str(folder))))

    def run(self, orders: Sequence[dict[str, Any]], on_frame: OnFrame) -> Iterator[Outcome]:
        """See :class:`generator.execution.executors.executor.Executor`."""
        for order in orders:
            yield self._slot.run(order, on_frame)

    def close(self) -> None:
        """End the render worker."""
        self._slot.close()

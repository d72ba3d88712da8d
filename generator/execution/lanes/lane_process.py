# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane in a child process, as its host sees it."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from generator import errors
from generator.errors import WorkerError
from generator.execution.lanes.lane import LaneOptions, OnFrame
from generator.execution.lanes.lines import LineProcess

PATIENCE = 1.5
"""How much longer than for its render worker one waits for a lane: it answers for both."""


class LaneProcess:
    """Starts ``python -m generator.execution.lanes.lane_main`` and speaks with it."""

    def __init__(self, options: LaneOptions) -> None:
        log = Path(options.scratch) / "lane.log"
        self._deadline_s = options.deadline_s * PATIENCE
        self._process = LineProcess([sys.executable, "-m", "generator.execution.lanes.lane_main"], log)
        self._process.send(asdict(options))
        self._ready = False

    @property
    def pid(self) -> int:
        """Process id of the lane; its render worker is a child of that."""
        return self._process.pid

    def run(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]:
        """See :meth:`generator.execution.lanes.lane.Lane.run`."""
        if not self._ready:
            # A lane that was orphaned while it started finds no order, and so nothing to do.
            self._process.receive(self._deadline_s)
            self._ready = True
        self._process.send(order)
        while True:
            answer = self._process.receive(self._deadline_s)
            if "frame" in answer:
                on_frame()
            elif "receipt" in answer:
                return answer["receipt"]
            elif answer["type"] == WorkerError.__name__:
                raise WorkerError(answer["error"], answer["log"])
            else:
                raise getattr(errors, answer["type"])(answer["error"])

    def close(self) -> None:
        """End the child and its render worker."""
        self._process.close()

    def kill(self) -> None:
        """End the child now; its render worker goes with it, see :mod:`generator.process`."""
        self._process.kill()

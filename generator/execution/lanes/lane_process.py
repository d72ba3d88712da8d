# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane in a child process, as its host sees it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from generator import errors
from generator.codec import to_plain
from generator.errors import WorkerError
from generator.execution.lanes.lines import LineProcess
from generator.execution.lanes.options import LaneOptions, OnImage
from generator.interpreter import python_command
from generator.messages import (
    LaneFailed,
    LaneOrder,
    LaneReady,
    Progressed,
    Receipt,
    expect,
    to_json,
)

PATIENCE = 1.5
"""How much longer than for its render worker one waits for a lane: it answers for both."""


class LaneProcess:
    """Starts :mod:`generator.execution.lanes.lane_main` and speaks with it."""

    def __init__(self, options: LaneOptions) -> None:
        log = Path(options.scratch) / "lane.log"
        self._deadline_s = options.deadline_s * PATIENCE
        self._process = LineProcess(python_command("generator.execution.lanes.lane_main"), log)
        self._process.send(to_plain(options))
        self._ready = False

    @property
    def pid(self) -> int:
        """Process id of the lane; its render worker is a child of that."""
        return self._process.pid

    def run(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        """See :class:`generator.execution.lanes.options.AnyLane`."""
        if not self._ready:
            # A lane that was orphaned while it started finds no order, and so nothing to do.
            expect(LaneReady, self._receive())
            self._ready = True
        self._process.send(to_json(order))
        while isinstance(answer := self._receive(), Progressed):
            on_image()
        if isinstance(answer, LaneFailed):
            if answer.kind == WorkerError.__name__:
                raise WorkerError(answer.reason, answer.log)
            raise getattr(errors, answer.kind)(answer.reason)
        receipt: Receipt = answer
        return receipt

    def close(self) -> None:
        """End the child and its render worker."""
        self._process.close()

    def kill(self) -> None:
        """End the child now; its render worker goes with it, see :mod:`generator.process`."""
        self._process.kill()

    def _receive(self) -> Any:
        return self._process.receive_message(self._deadline_s)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A place for a lane: a lane that breaks is replaced and its order tried again."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from generator.errors import HeadError, WorkerError
from generator.execution.lanes.options import AnyLane, OnImage
from generator.messages import LaneOrder, Receipt

ATTEMPTS = 3
"""How often an order is tried, each time in a fresh lane, before it is given up."""


@dataclass(frozen=True)
class Outcome:
    """What became of one order: a receipt, or the reason why there is none.

    attempts: in how many lanes it was tried. log: the end of the last one's log.
    """

    order: LaneOrder
    receipt: Receipt | None
    error: str = ""
    attempts: int = 1
    log: str = ""


class LaneSlot:
    """Keeps one lane running. close may be called from another thread than run."""

    def __init__(self, open_lane: Callable[[], AnyLane]) -> None:
        self._open = open_lane
        self._lock = threading.Lock()
        self._lane: AnyLane | None = None
        self._busy = self._closed = False

    def run(self, order: LaneOrder, on_image: OnImage) -> Outcome:
        """Carry out one order. Raises whatever makes the whole build pointless (DatasetError)."""
        failed = WorkerError("the build was stopped")
        self._busy = True
        for attempt in range(1, ATTEMPTS + 1):
            try:
                receipt = self._ready_lane().run(order, on_image)
            except HeadError as error:
                self._busy = False
                return Outcome(order, None, str(error), attempt)
            except WorkerError as error:
                failed = error
                if self._closed:
                    break
                self._discard()
            else:
                self._busy = False
                return Outcome(order, receipt, attempts=attempt)
        return Outcome(order, None, str(failed), ATTEMPTS, failed.log)

    def close(self) -> None:
        """End the lane, at once if it is in the middle of an order."""
        self._closed = True
        self._discard()

    def _ready_lane(self) -> AnyLane:
        with self._lock:
            if self._closed:
                raise WorkerError("the build was stopped")
            if self._lane is None:
                self._lane = self._open()
            return self._lane

    def _discard(self) -> None:
        with self._lock:
            lane, self._lane = self._lane, None
        if lane is not None:
            if self._busy:
                lane.kill()
            else:
                lane.close()

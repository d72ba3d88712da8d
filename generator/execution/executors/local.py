# SPDX-License-Identifier: GPL-3.0-or-later
"""Several lanes on this machine, each a process that keeps to its share of the cores."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from generator.cgroup import worthwhile
from generator.execution.executors.executor import Circumstances, share_cores
from generator.execution.executors.order_queue import OrderQueue
from generator.execution.lanes.lane_process import LaneProcess
from generator.execution.lanes.options import OnImage
from generator.execution.lanes.slot import LaneSlot, Outcome
from generator.messages import LaneOrder
from generator.process import available_cores


class LocalExecutor:
    """See :class:`generator.execution.executors.executor.Executor`.

    A lane renders on one core and detects on the same one: the two alternate, so
    a second lane on the second core doubles the rate, while two that share cores
    get in each other's way.
    """

    name = "local"

    def __init__(self, given: Circumstances) -> None:
        busy = worthwhile(available_cores())
        self.workers = given.workers or busy
        most = max(1, busy // self.workers)
        self._slots = []
        for k, cpus in enumerate(share_cores(self.workers)):
            folder = given.scratch / f"lane{k}"
            folder.mkdir()
            own = replace(given.options, scratch=str(folder), threads=min(len(cpus), most), cpus=cpus)
            if own.gpu is not None:
                own = replace(own, gpu=k)
            self._slots.append(LaneSlot(partial(LaneProcess, own)))
        # A lane ends with the thread that started it, so these threads live as long as the lanes.
        self._threads = ThreadPoolExecutor(self.workers)

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """See :class:`generator.execution.executors.executor.Executor`."""
        waiting = OrderQueue(orders)
        outcomes: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        stop = threading.Event()

        def serve(slot: LaneSlot) -> None:
            head = None
            while not stop.is_set() and (taken := waiting.take(head)) is not None:
                head, order = taken
                try:
                    outcomes.put(slot.run(order, on_image))
                except Exception as error:  # handed to the thread that waits, which raises it
                    outcomes.put(error)
                    return

        for slot in self._slots:
            self._threads.submit(serve, slot)
        try:
            for _ in orders:
                outcome = outcomes.get()
                if isinstance(outcome, Exception):
                    raise outcome
                yield outcome
        finally:
            stop.set()

    def close(self) -> None:
        """End every lane."""
        for slot in self._slots:
            slot.close()
        self._threads.shutdown()

# SPDX-License-Identifier: GPL-3.0-or-later
"""One interface, several executors: orders in, receipts out, in any order."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from generator import errors
from generator.errors import HeadError, WorkerError
from generator.execution.lane import Lane, LaneOptions, OnFrame
from generator.execution.lines import LineProcess
from generator.execution.order_queue import OrderQueue

ATTEMPTS = 3
"""How often an order is tried, each time in a fresh lane, before it is given up."""


@dataclass(frozen=True)
class Outcome:
    """What became of one order: a receipt, or the reason why there is none."""

    order: dict[str, Any]
    receipt: dict[str, Any] | None
    error: str = ""
    attempts: int = 1


class AnyLane(Protocol):
    """A lane in this process or another; see :class:`generator.execution.lane.Lane`."""

    def run(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]: ...

    def close(self) -> None: ...

    def kill(self) -> None: ...


class LaneProcess:
    """A lane in a child process."""

    def __init__(self, options: LaneOptions) -> None:
        log = Path(options.scratch) / "lane.log"
        self._process = LineProcess([sys.executable, "-m", "generator.execution.lane"], log)
        self._process.send(asdict(options))

    def run(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]:
        """See :meth:`generator.execution.lane.Lane.run`."""
        self._process.send(order)
        while True:
            answer = self._process.receive()
            if "frame" in answer:
                on_frame()
            elif "receipt" in answer:
                return answer["receipt"]
            else:
                raise getattr(errors, answer["type"])(answer["error"])

    def close(self) -> None:
        """End the child and its render worker."""
        self._process.close()

    def kill(self) -> None:
        """End the child now; its render worker follows at its next frame."""
        self._process.kill()


class LaneSlot:
    """A place for a lane: a lane that breaks is replaced and its order tried again."""

    def __init__(self, open_lane: Callable[[], AnyLane]) -> None:
        self._open = open_lane
        self._lane: AnyLane | None = None
        self._busy = self._closed = False

    def run(self, order: dict[str, Any], on_frame: OnFrame) -> Outcome:
        """Carry out one order. Raises whatever makes the whole build pointless (DatasetError)."""
        reason = ""
        self._busy = True
        for attempt in range(1, ATTEMPTS + 1):
            try:
                if self._lane is None:
                    self._lane = self._open()
                receipt = self._lane.run(order, on_frame)
            except HeadError as error:
                self._busy = False
                return Outcome(order, None, str(error), attempt)
            except WorkerError as error:
                reason = str(error)
                if self._closed:
                    break
                self._discard()
            else:
                self._busy = False
                return Outcome(order, receipt, attempts=attempt)
        return Outcome(order, None, reason, ATTEMPTS)

    def close(self) -> None:
        """End the lane, at once if it is in the middle of an order."""
        self._closed = True
        self._discard()

    def _discard(self) -> None:
        lane, self._lane = self._lane, None
        if lane is not None:
            if self._busy:
                lane.kill()
            else:
                lane.close()


class Executor(Protocol):
    """Carries out orders."""

    def run(self, orders: Sequence[dict[str, Any]], on_frame: OnFrame) -> Iterator[Outcome]:
        """Yield the outcome of each order as it comes; on_frame may be called from any thread."""
        ...

    def close(self) -> None:
        """End every process that was started."""
        ...


class SerialExecutor:
    """One lane in this process, one order after another: for tests and debugging."""

    def __init__(self, scratch: Path, *, blender: str | None = None, min_confidence: float = 0.5) -> None:
        folder = scratch / "lane0"
        folder.mkdir()
        options = LaneOptions(str(folder), blender=blender, min_confidence=min_confidence)
        self._slot = LaneSlot(lambda: Lane(options))

    def run(self, orders: Sequence[dict[str, Any]], on_frame: OnFrame) -> Iterator[Outcome]:
        """See :class:`Executor`."""
        for order in orders:
            yield self._slot.run(order, on_frame)

    def close(self) -> None:
        """End the render worker."""
        self._slot.close()


class LocalExecutor:
    """Several lanes on this machine, each a process that keeps to its share of the cores.

    A lane renders on one core and detects on the same one: the two alternate, so
    a second lane on the second core doubles the rate, while two that share cores
    get in each other's way.
    """

    def __init__(
        self, scratch: Path, workers: int, *, blender: str | None = None, min_confidence: float = 0.5
    ) -> None:
        self._slots = [
            LaneSlot(self._opener(scratch / f"lane{k}", cpus, blender, min_confidence))
            for k, cpus in enumerate(share_cores(workers))
        ]

    @staticmethod
    def _opener(
        folder: Path, cpus: tuple[int, ...], blender: str | None, min_confidence: float
    ) -> Callable[[], AnyLane]:
        folder.mkdir()
        options = LaneOptions(str(folder), blender, len(cpus), cpus, min_confidence)
        return lambda: LaneProcess(options)

    def run(self, orders: Sequence[dict[str, Any]], on_frame: OnFrame) -> Iterator[Outcome]:
        """See :class:`Executor`."""
        waiting = OrderQueue(orders)
        outcomes: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        stop = threading.Event()

        def serve(slot: LaneSlot) -> None:
            head = None
            while not stop.is_set() and (taken := waiting.take(head)) is not None:
                head, order = taken
                try:
                    outcomes.put(slot.run(order, on_frame))
                except Exception as error:  # handed to the thread that waits, which raises it
                    outcomes.put(error)
                    return

        threads = [threading.Thread(target=serve, args=(slot,), daemon=True) for slot in self._slots]
        for thread in threads:
            thread.start()
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

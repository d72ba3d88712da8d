# SPDX-License-Identifier: MIT
"""Landmarkers of one kind for any number of threads.

Neither a graph of MediaPipe's nor an interpreter of LiteRT's may be used by two threads at once, and both
let other threads run while they work. So each look borrows one that is free; there are as many as threads
that look at the same time, but no more than cores. What each finds depends on the picture alone.
"""

from __future__ import annotations

import contextlib
import os
import queue
import weakref
from collections.abc import Callable, Iterator

from downstream_hpe.prediction.landmarkers import Landmarker

_LEFT_BEHIND: list[object] = []
"""What a fork took along: its threads are not there, and freeing it would wait for them."""


class LandmarkerPool:
    """create: makes one, when it is first needed."""

    def __init__(self, create: Callable[[], Landmarker]) -> None:
        self._create = create
        self._begin()
        _POOLS.add(self)

    def _begin(self) -> None:
        # The last one that was put back is taken first, so that a single thread has a single one.
        self._free: queue.LifoQueue[Landmarker | None] = queue.LifoQueue()
        for _ in range(os.cpu_count() or 1):
            self._free.put(None)

    @contextlib.contextmanager
    def one(self) -> Iterator[Landmarker]:
        """One that nobody else uses meanwhile."""
        landmarker = self._free.get()
        try:
            landmarker = landmarker or self._create()
            yield landmarker
        finally:
            self._free.put(landmarker)

    def close(self) -> None:
        """Free the models of those that nobody uses; the next look opens them anew."""
        free: list[Landmarker | None] = []
        with contextlib.suppress(queue.Empty):
            while True:
                free.append(self._free.get_nowait())
        for landmarker in free:
            if landmarker is not None:
                landmarker.close()
            self._free.put(None)

    def after_fork(self) -> None:
        """In the child, which has none of the threads: with landmarkers of its own from now on."""
        _LEFT_BEHIND.append(self._free)
        self._begin()


_POOLS: weakref.WeakSet[LandmarkerPool] = weakref.WeakSet()


def _after_fork() -> None:
    for pool in list(_POOLS):
        pool.after_fork()


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_after_fork)

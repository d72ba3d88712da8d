# SPDX-License-Identifier: GPL-3.0-or-later
"""Which order a lane takes next: one of the head it already holds, if there is any."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Sequence

from generator.messages import BuildOrder, LaneOrder

Key = str


class OrderQueue:
    """Orders grouped by head, handed out so that heads are loaded as rarely as possible.

    Thread-safe. Orders without a head each form a group of their own.
    """

    def __init__(self, orders: Sequence[LaneOrder]) -> None:
        self._lock = threading.Lock()
        self._groups: dict[Key, deque[LaneOrder]] = {}
        self._holders: Counter[Key] = Counter()
        for number, order in enumerate(orders):
            key = order.head.name if isinstance(order, BuildOrder) else f"#{number}"
            self._groups.setdefault(key, deque()).append(order)

    def take(self, held: Key | None) -> tuple[Key, LaneOrder] | None:
        """The next order and its key for a lane that holds a head; None when nothing is left.

        Without an order for the held head: the first head nobody holds, else the
        one with most orders left for each lane that would share it.
        """
        with self._lock:
            if held in self._groups:
                key = held
            elif self._groups:
                free = (k for k in self._groups if not self._holders[k])
                key = next(free, None) or max(
                    self._groups, key=lambda k: len(self._groups[k]) / (1 + self._holders[k])
                )
            else:
                return None
            if key != held:
                self._holders[key] += 1
                if held is not None:
                    self._holders[held] -= 1
            group = self._groups[key]
            order = group.popleft()
            if not group:
                del self._groups[key]
            return key, order

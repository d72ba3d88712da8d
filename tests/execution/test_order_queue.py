# SPDX-License-Identifier: GPL-3.0-or-later
"""Which order a lane takes next."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from pathlib import Path

import pytest
from fake_lane import unit_order
from hypothesis import given
from hypothesis import strategies as st

from generator.execution.executors.order_queue import OrderQueue
from generator.messages import BuildOrder, LaneOrder, VersionsOrder

ROOT = Path("/nowhere")


def orders_of(*subjects: str) -> list[LaneOrder]:
    """One a subject, in this order."""
    return [unit_order(ROOT, f"plain-{k}", subject) for k, subject in enumerate(subjects)]


def taken(waiting: OrderQueue, held: str | None = None) -> tuple[str, str]:
    """Head and unit of the next order."""
    found = waiting.take(held)
    assert found is not None
    key, order = found
    assert isinstance(order, BuildOrder)
    return key, order.unit


def test_nothing_left_is_none() -> None:
    assert OrderQueue([]).take(None) is None
    waiting = OrderQueue(orders_of("amy"))
    key, _ = taken(waiting)
    assert key == "amy/neutral"
    assert waiting.take(key) is None and waiting.take(None) is None


def test_a_lane_stays_with_its_head_as_long_as_there_is_something() -> None:
    waiting = OrderQueue(orders_of("amy", "bob", "amy", "bob", "amy"))
    held, units = None, []
    for _ in range(5):
        held, unit = taken(waiting, held)
        units.append(unit)
    assert units == ["plain-0", "plain-2", "plain-4", "plain-1", "plain-3"]


def test_another_lane_takes_a_head_that_nobody_holds() -> None:
    waiting = OrderQueue(orders_of("amy", "amy", "amy", "bob", "cat"))
    assert [taken(waiting)[0] for _ in range(3)] == ["amy/neutral", "bob/neutral", "cat/neutral"]


def test_where_all_are_held_the_one_with_most_left_for_each_lane_is_shared() -> None:
    waiting = OrderQueue(orders_of(*["amy"] * 4, *["bob"] * 7, "cat"))
    assert [taken(waiting)[0][0] for _ in range(3)] == ["a", "b", "c"]
    # Left for each lane, once another has joined: 3/2 of amy, 6/2 of bob; then 5/3; then 4/4.
    assert taken(waiting, "cat/neutral")[0] == "bob/neutral"
    assert taken(waiting)[0] == "bob/neutral"
    assert taken(waiting)[0] == "amy/neutral"


def test_orders_without_a_head_are_each_their_own() -> None:
    waiting = OrderQueue([VersionsOrder(), VersionsOrder()])
    first, second = waiting.take(None), waiting.take(None)
    assert first is not None and second is not None and first[0] != second[0]
    assert waiting.take(first[0]) is None


@given(
    st.lists(st.sampled_from(["amy", "bob", "cat", "dan"]), max_size=30),
    st.lists(st.integers(0, 3), min_size=200, max_size=200),
)
def test_every_order_is_given_out_once_whoever_asks(subjects: list[str], lanes: list[int]) -> None:
    orders = orders_of(*subjects)
    waiting, held = OrderQueue(orders), dict.fromkeys(range(4), None)
    given_out: list[LaneOrder] = []
    switches: Counter[str] = Counter()
    for lane in lanes:
        found = waiting.take(held[lane])
        if found is None:
            break
        switches[found[0]] += found[0] != held[lane]
        held[lane] = found[0]  # type: ignore[assignment]
        given_out.append(found[1])
    assert Counter(map(id, given_out)) == Counter(map(id, orders))
    assert all(times <= 4 for times in switches.values()), "no lane loads a head twice"


class Slow(deque):
    """Lets other threads in between looking at its first element and taking it."""

    def popleft(self) -> LaneOrder:
        """See deque."""
        first = self[0]
        time.sleep(1e-4)
        super().popleft()
        return first


def test_lanes_may_ask_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("generator.execution.executors.order_queue.deque", Slow)
    orders = orders_of(*["amy"] * 60)
    waiting = OrderQueue(orders)
    given_out: list[LaneOrder] = []
    errors: list[BaseException] = []
    start = threading.Barrier(4)

    def lane() -> None:
        held = None
        start.wait()
        try:
            while (found := waiting.take(held)) is not None:
                held = found[0]
                given_out.append(found[1])
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=lane) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert not errors
    assert Counter(map(id, given_out)) == Counter(map(id, orders))


@pytest.mark.parametrize("held", [None, "of another run"])
def test_a_key_that_is_not_known_is_no_hindrance(held: str | None) -> None:
    assert OrderQueue(orders_of("amy")).take(held) is not None

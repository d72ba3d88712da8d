# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane that breaks is replaced; one that is closed stays so."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from generator.errors import DatasetError, HeadError, WorkerError
from generator.execution.lanes.options import OnImage
from generator.execution.lanes.slot import ATTEMPTS, LaneSlot, Outcome
from generator.messages import LaneOrder, Receipt, Versions, VersionsOrder

ORDER = VersionsOrder()
RECEIPT = Versions({"lane": "1"})


class Lane:
    """Does what it is told to, and remembers how it was ended."""

    def __init__(self, act: Callable[[], None]) -> None:
        self._act, self.ended = act, ""

    def run(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        """See AnyLane."""
        on_image()
        self._act()
        return RECEIPT

    def close(self) -> None:
        """See AnyLane."""
        self.ended = "closed"

    def kill(self) -> None:
        """See AnyLane."""
        self.ended = "killed"


class Lanes:
    """Opens lanes, each with the next thing that happens in it; the last one serves for all that follow."""

    def __init__(self, *acts: BaseException | None) -> None:
        self._acts = list(acts)
        self.opened: list[Lane] = []

    def __call__(self) -> Lane:
        self.opened.append(Lane(self._act))
        return self.opened[-1]

    def _act(self) -> None:
        act = self._acts.pop(0) if len(self._acts) > 1 else self._acts[0]
        if act is not None:
            raise act

    @property
    def ended(self) -> list[str]:
        """How each was ended; "" if it runs."""
        return [lane.ended for lane in self.opened]


def run(slot: LaneSlot) -> Outcome:
    return slot.run(ORDER, lambda: None)


def test_a_lane_is_opened_when_it_is_needed_and_kept() -> None:
    lanes = Lanes(None)
    slot = LaneSlot(lanes)
    assert not lanes.opened
    assert run(slot) == run(slot) == Outcome(ORDER, RECEIPT)
    assert lanes.ended == [""]
    slot.close()
    assert lanes.ended == ["closed"]


def test_images_are_passed_on() -> None:
    seen: list[None] = []
    LaneSlot(Lanes(None)).run(ORDER, lambda: seen.append(None))
    assert len(seen) == 1


def test_a_bad_head_costs_no_lane() -> None:
    lanes = Lanes(None, HeadError("no face"))
    slot = LaneSlot(lanes)
    assert run(slot).receipt == RECEIPT
    assert run(slot) == Outcome(ORDER, None, "no face", 1)
    assert lanes.ended == [""]
    slot.close()
    assert lanes.ended == ["closed"], "it is not in the middle of anything"


def test_a_lane_that_breaks_is_killed_and_replaced() -> None:
    lanes = Lanes(WorkerError("broken"), None)
    assert run(LaneSlot(lanes)) == Outcome(ORDER, RECEIPT, attempts=2)
    assert lanes.ended == ["killed", ""]


def test_after_so_many_attempts_an_order_is_given_up_and_the_next_gets_a_fresh_lane() -> None:
    breaks = [WorkerError(f"broken {k}", f"log {k}") for k in range(ATTEMPTS)]
    lanes = Lanes(*breaks, None)
    slot = LaneSlot(lanes)
    last = ATTEMPTS - 1
    assert run(slot) == Outcome(ORDER, None, f"broken {last}", ATTEMPTS, f"log {last}")
    assert lanes.ended == ["killed"] * ATTEMPTS
    assert run(slot) == Outcome(ORDER, RECEIPT)
    assert lanes.ended == [*["killed"] * ATTEMPTS, ""]


def test_a_lane_that_cannot_be_opened_is_tried_as_often() -> None:
    tries = []

    def refuse() -> Lane:
        tries.append(None)
        raise WorkerError("cannot start")

    assert run(LaneSlot(refuse)) == Outcome(ORDER, None, "cannot start", ATTEMPTS)
    assert len(tries) == ATTEMPTS


def test_what_makes_the_build_pointless_is_raised() -> None:
    lanes = Lanes(DatasetError("disk full"))
    slot = LaneSlot(lanes)
    with pytest.raises(DatasetError, match="disk full"):
        run(slot)
    slot.close()
    assert lanes.ended == ["killed"]


def test_a_closed_slot_opens_no_lane() -> None:
    lanes = Lanes(None)
    slot = LaneSlot(lanes)
    slot.close()
    outcome = run(slot)
    assert outcome.receipt is None and outcome.error == "the build was stopped"
    assert not lanes.opened
    slot.close()  # once more does no harm


def test_closing_in_the_middle_of_an_order_kills_the_lane_and_tries_no_other() -> None:
    begun, ended = threading.Event(), threading.Event()

    class Busy(Lane):
        def kill(self) -> None:
            """The order it is at fails, as that of a killed process does."""
            super().kill()
            ended.set()

    def wait() -> None:
        begun.set()
        assert ended.wait(20)
        raise WorkerError("was killed")

    lanes = [Busy(wait)]
    slot = LaneSlot(lambda: lanes[0] if not begun.is_set() else pytest.fail("another lane was opened"))
    outcomes: list[Outcome] = []
    worker = threading.Thread(target=lambda: outcomes.append(run(slot)))
    worker.start()
    assert begun.wait(20)
    slot.close()
    worker.join(20)
    assert lanes[0].ended == "killed"
    assert [outcome.receipt for outcome in outcomes] == [None]
    assert outcomes[0].error == "was killed"

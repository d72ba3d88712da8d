# SPDX-License-Identifier: GPL-3.0-or-later
"""What every executor promises, whoever carries the orders out."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest
from fake_lane import FakeLane, read_journal, unit_order

from generator import registries
from generator.errors import DatasetError
from generator.execution.executors.executor import Circumstances, Executor
from generator.execution.lanes import lane_process
from generator.execution.lanes.lines import LineProcess
from generator.execution.lanes.options import LaneOptions
from generator.execution.lanes.slot import ATTEMPTS, Outcome
from generator.messages import Built, LaneOrder, Placed, PlaceOrder, Versions, VersionsOrder
from generator.process import is_running

HERE = Path(__file__).parent
WORKERS = 2

pytestmark = [
    pytest.mark.skipif(find_spec("cv2") is None, reason="a lane needs OpenCV"),
    *(
        pytest.mark.filterwarnings(f"ignore::{what}")  # Ray's own, which are not ours to mend
        for what in (
            *("DeprecationWarning", "FutureWarning", "ResourceWarning"),
            "pytest.PytestUnraisableExceptionWarning",
        )
    ),
]

EXECUTORS = [
    "serial",
    "local",
    pytest.param(
        "ray",
        marks=[
            pytest.mark.slow,
            pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed"),
        ],
    ),
]
IN_PROCESSES = EXECUTORS[1:]
"""Those whose lanes may die alone."""


@pytest.fixture(scope="module")
def kept() -> Iterator[dict[str, Executor]]:
    """Executors that are open: they take time to start, so one serves several tests."""
    executors: dict[str, Executor] = {}
    yield executors
    for executor in executors.values():
        executor.close()


@pytest.fixture
def opened(
    request: pytest.FixtureRequest,
    kept: dict[str, Executor],
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> Executor:
    """An executor whose lanes are fake; the parameter is its name."""
    name = request.param
    with_fake_lanes(name, monkeypatch)
    if name not in kept:
        given = Circumstances(tmp_path_factory.mktemp("scratch"), WORKERS, None, LaneOptions())
        before = os.environ.copy()
        kept[name] = registries.EXECUTORS.get(name)(given)
        assert os.environ == before, "what it starts has an environment of its own; the caller keeps his"
    return kept[name]


def with_fake_lanes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the executor of that name start fake lanes."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE.parents[1]), str(HERE)]))
    if name == "serial":
        monkeypatch.setattr("generator.execution.executors.serial.Lane", FakeLane)
    elif name == "local":
        program = [sys.executable, str(HERE / "fake_lane.py")]
        monkeypatch.setattr(lane_process, "LineProcess", lambda _, log: LineProcess(program, log))
    else:
        # Not imported before: whether Ray listens beyond this machine is decided when it is.
        from fake_actor import FakeLaneActor

        monkeypatch.setattr("generator.execution.executors.ray.LaneActor", FakeLaneActor)


def outcomes_of(
    executor: Executor, orders: Sequence[LaneOrder], on_image: Any = lambda: None
) -> dict[str, Outcome]:
    """By unit; the order in which they come is free."""
    return {outcome.order.unit: outcome for outcome in executor.run(orders, on_image)}  # type: ignore[union-attr]


def lanes_of(root: Path, unit: str) -> list[str]:
    """Lanes in which a unit was tried."""
    return [entry.lane for entry in read_journal(root) if entry.what == "run" and entry.unit == unit]


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_every_order_has_one_outcome(opened: Executor, tmp_path: Path) -> None:
    heads = (unit_order(tmp_path, "plain").head,) * 2
    orders: list[LaneOrder] = [VersionsOrder(), PlaceOrder(heads, "source")]
    orders += [unit_order(tmp_path, f"plain-{k}", f"s{k // 4}") for k in range(10)]
    outcomes = list(opened.run(orders, lambda: None))
    assert Counter(id(outcome.order) for outcome in outcomes) == Counter(map(id, orders)), "the very orders"
    kinds = {VersionsOrder: Versions, PlaceOrder: Placed}
    for outcome in outcomes:
        assert isinstance(outcome.receipt, kinds.get(type(outcome.order), Built))
        assert (outcome.error, outcome.attempts, outcome.log) == ("", 1, "")
        if isinstance(outcome.receipt, Built):
            assert outcome.receipt.part.path == outcome.order.part_path  # type: ignore[union-attr]
        if isinstance(outcome.receipt, Placed):
            assert [fact.error for fact in outcome.receipt.facts] == ["not looked at"] * 2
    assert len(read_journal(tmp_path)) == 10, "and none was carried out twice"


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_it_may_be_used_again(opened: Executor, tmp_path: Path) -> None:
    assert list(opened.run([], lambda: None)) == []
    for name in ("plain-1", "plain-2"):
        assert outcomes_of(opened, [unit_order(tmp_path, name)])[name].receipt is not None


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_images_are_told_of_one_by_one(opened: Executor, tmp_path: Path) -> None:
    seen: list[None] = []
    orders = [unit_order(tmp_path, f"plain-{k}", images=k + 1) for k in range(3)]
    outcomes_of(opened, [*orders, unit_order(tmp_path, "head")], lambda: seen.append(None))
    assert len(seen) == 1 + 2 + 3


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
@pytest.mark.parametrize(
    ("unit", "reason"), [("head", "a.obj: not a head"), ("missing", "the texture 'a.png' is missing")]
)
def test_a_head_that_cannot_be_built_is_not_tried_again(
    opened: Executor, unit: str, reason: str, tmp_path: Path
) -> None:
    found = outcomes_of(opened, [unit_order(tmp_path, unit), unit_order(tmp_path, "plain")])
    bad = found[unit]
    assert (bad.receipt, bad.error, bad.attempts) == (None, reason, 1)
    assert len(lanes_of(tmp_path, unit)) == 1
    assert found["plain"].receipt is not None


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_what_breaks_is_tried_in_fresh_lanes_and_given_up(opened: Executor, tmp_path: Path) -> None:
    found = outcomes_of(opened, [unit_order(tmp_path, "breaks"), unit_order(tmp_path, "plain")])
    bad = found["breaks"]
    assert (bad.receipt, bad.error, bad.attempts) == (None, "Blender was killed", ATTEMPTS)
    assert bad.log == "the last line of its log"
    assert len(set(lanes_of(tmp_path, "breaks"))) == len(lanes_of(tmp_path, "breaks")) == ATTEMPTS
    assert found["plain"].receipt is not None, "and nobody else suffers"


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_what_breaks_once_is_built(opened: Executor, tmp_path: Path) -> None:
    outcome = outcomes_of(opened, [unit_order(tmp_path, "once")])["once"]
    assert outcome.receipt is not None and outcome.attempts == 2
    assert len(set(lanes_of(tmp_path, "once"))) == 2


@pytest.mark.parametrize("opened", IN_PROCESSES, indirect=True)
def test_a_lane_that_dies_is_replaced(opened: Executor, tmp_path: Path) -> None:
    found = outcomes_of(opened, [unit_order(tmp_path, "dies_once"), unit_order(tmp_path, "plain")])
    assert found["dies_once"].receipt is not None and found["plain"].receipt is not None
    assert len(set(lanes_of(tmp_path, "dies_once"))) == 2


@pytest.mark.parametrize("opened", IN_PROCESSES, indirect=True)
def test_what_kills_every_lane_is_given_up(opened: Executor, tmp_path: Path) -> None:
    bad = outcomes_of(opened, [unit_order(tmp_path, "dies")])["dies"]
    assert bad.receipt is None and bad.error and bad.attempts == ATTEMPTS
    assert len(set(lanes_of(tmp_path, "dies"))) == ATTEMPTS


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_a_full_disk_ends_the_run(opened: Executor, tmp_path: Path) -> None:
    orders = [unit_order(tmp_path, "disk"), *(unit_order(tmp_path, f"slow-{k}", "bob") for k in range(300))]
    with pytest.raises(DatasetError, match="no space left on device"):
        outcomes_of(opened, orders)
    assert len(lanes_of(tmp_path, "disk")) == 1
    time.sleep(0.3)  # what was begun may be finished
    done = len(read_journal(tmp_path))
    assert done < len(orders)
    time.sleep(0.3)
    assert len(read_journal(tmp_path)) == done, "but no lane goes on"


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
def test_orders_of_a_head_go_to_the_lane_that_holds_it(opened: Executor, tmp_path: Path) -> None:
    """However they come: a lane takes another head only when its own is done."""
    subjects = ("amy", "bob", "cat", "dan")
    orders = [unit_order(tmp_path, f"plain-{s}{k}", s) for s in subjects for k in range(4)]
    if opened.name != "serial":  # which takes them as they come: head by head
        orders = [order for k in range(4) for order in orders[k::4]]
    outcomes_of(opened, orders)
    by_lane = defaultdict(list)
    for entry in read_journal(tmp_path):
        by_lane[entry.lane].append(entry.head)
    for heads in by_lane.values():
        runs = [head for head, _ in groupby(heads)]
        assert len(runs) == len(set(runs)), heads


@pytest.mark.parametrize("opened", EXECUTORS, indirect=True)
@pytest.mark.parametrize("midway", [False, True], ids=["idle", "in the middle"])
def test_close_ends_every_lane(
    opened: Executor, kept: dict[str, Executor], midway: bool, tmp_path: Path
) -> None:
    del kept[opened.name]
    others = [unit_order(tmp_path, f"waits-{k}", f"s{k}") for k in range(4)] if midway else []
    outcomes = opened.run([unit_order(tmp_path, "plain"), *others], lambda: None)
    assert next(outcomes).receipt is not None
    if not midway:
        assert not list(outcomes)
    elif opened.name == "local":
        wait_for(lambda: any(entry.unit.startswith("waits") for entry in read_journal(tmp_path)))
    start = time.monotonic()
    opened.close()
    assert time.monotonic() - start < 20
    journal = read_journal(tmp_path)
    ended = {entry.lane for entry in journal if entry.what in ("close", "kill")}
    for entry in journal:
        assert entry.lane in ended or (entry.pid != os.getpid() and gone(entry.pid)), entry
    assert all(entry.pid == os.getpid() or gone(entry.pid) for entry in journal)
    if not midway:
        assert {entry.lane for entry in journal} == ended, "in order, where there is time"


def wait_for(condition: Any, patience_s: float = 20.0) -> None:
    """Until it is so; fails after some time."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.02)


def gone(pid: int, patience_s: float = 10.0) -> bool:
    """Does a process end within some time?"""
    deadline = time.monotonic() + patience_s
    while is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not is_running(pid)

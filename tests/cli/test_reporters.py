# SPDX-License-Identifier: GPL-3.0-or-later
"""What people and machines see of a build."""

from __future__ import annotations

import io
import json
import threading
import time
from typing import Any

import pytest
from rich.console import Console

from generator.cli import reporter as module
from generator.cli.reporter import JsonReporter, Tally, TerminalReporter

UNIT = {"attempts": 1, "seconds": {"wait for render": 6.0, "detect": 3.0, "encode": 1.0}}


class Clock:
    """Stands for the time; moves when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        """See time."""
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """In the place of the one that the reporter looks at."""
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def printed(terminal: bool, use: Any) -> str:
    """What a console showed; of a terminal with everything that was drawn over."""
    file = io.StringIO()
    console = Console(
        file=file, force_terminal=terminal, width=160, color_system=None, emoji=False, _environ={}
    )
    with TerminalReporter(console) as reporter:
        use(reporter)
    return file.getvalue()


def test_a_tally_adds_up_what_happened() -> None:
    tally = Tally()
    assert (str(tally), tally.load) == ("", {})
    tally.add("unit", UNIT)
    tally.add("unit", {"attempts": 3, "seconds": {"detect": 2.0, "load": 0.0}})
    tally.add("quarantined", {"attempts": 3, "reason": "broken"})
    assert (tally.units, tally.restarts, tally.quarantined) == (2, 4, 1)
    assert tally.load == {"wait for render": 0.5, "detect": 0.417, "encode": 0.083, "load": 0.0}
    assert str(tally) == "wait for render 50% · detect 42% · encode 8% · 4 restarts · 1 quarantined"


def test_where_there_is_no_terminal_there_are_plain_lines() -> None:
    def use(reporter: TerminalReporter) -> None:
        reporter.advance()  # before any stage it means nothing
        reporter.stage("rendering", 12)
        reporter.advance(5)
        reporter.note("skipped [bold]amy[/bold]/:smile: " + "x" * 200)
        reporter.event("unit", UNIT)

    assert printed(False, use) == "rendering: 12\nskipped [bold]amy[/bold]/:smile: " + "x" * 200 + "\n"


def test_a_terminal_has_a_bar_with_what_the_events_add_up_to() -> None:
    def use(reporter: TerminalReporter) -> None:
        reporter.stage("preparing heads", 2)
        reporter.advance()
        reporter.stage("rendering", 12)
        reporter.advance(5)
        reporter.event("unit", UNIT)
        reporter.note("a note")

    shown = printed(True, use)
    assert "a note\n" in shown
    first, second = (
        [line for line in shown.splitlines() if name in line][-1] for name in ("heads", "rendering")
    )
    assert "1/2" in first
    assert "5/12" in second and "wait for render 60% · detect 30% · encode 10%" in second


def test_a_question_has_the_terminal_to_itself() -> None:
    seen = []

    def use(reporter: TerminalReporter) -> None:
        running = reporter._progress.live
        seen.append(running.is_started)
        with reporter.paused():
            seen.append(running.is_started)
        seen.append(running.is_started)
        with pytest.raises(KeyboardInterrupt), reporter.paused():
            raise KeyboardInterrupt

    printed(True, use)
    assert seen == [True, False, True]


class Machine:
    """What a program reads from a JsonReporter."""

    def __init__(self) -> None:
        self._file = io.StringIO()
        self.reporter = JsonReporter(self._file)

    def lines(self, *keys: str) -> list[Any]:
        """Every line; or these values of each that has them."""
        said = [json.loads(line) for line in self._file.getvalue().splitlines()]
        return [tuple(line[key] for key in keys) for line in said if {*keys} <= set(line)] if keys else said


def test_machines_get_a_line_for_everything_that_happens(clock: Clock) -> None:
    machine = Machine()
    with machine.reporter as reporter:
        reporter.stage("rendering", 3)
        reporter.note('Zoë said "no"\nand went')
        reporter.event("unit", UNIT)
        reporter.event("error", {"reason": "no", "exit_code": 1})
    assert machine.lines() == [
        {"event": "stage", "stage": "rendering", "total": 3},
        {"event": "note", "text": 'Zoë said "no"\nand went'},
        {"event": "unit", **UNIT},
        {"event": "error", "reason": "no", "exit_code": 1},
    ]


def test_progress_is_told_about_once_a_second_and_at_the_end(clock: Clock) -> None:
    machine = Machine()
    machine.reporter.stage("rendering", 100)
    for _ in range(100):
        clock.now += 0.25
        machine.reporter.advance()
    done = machine.lines("done", "total")
    assert done == [(k, 100) for k in range(4, 101, 4)]


def test_progress_tells_rate_time_left_load_and_troubles(clock: Clock) -> None:
    machine = Machine()
    machine.reporter.stage("rendering", 100)
    machine.reporter.event("unit", {**UNIT, "attempts": 2})
    machine.reporter.event("quarantined", {"attempts": 3})
    clock.now += 10
    machine.reporter.advance(40)
    assert machine.lines()[-1] == {
        "event": "progress",
        "stage": "rendering",
        "done": 40,
        "total": 100,
        "rate": 4.0,
        "eta_s": 15.0,
        "load": {"wait for render": 0.6, "detect": 0.3, "encode": 0.1},
        "restarts": 3,
        "quarantined": 1,
    }


def test_another_stage_counts_from_its_own_beginning(clock: Clock) -> None:
    machine = Machine()
    machine.reporter.stage("preparing heads", 1)
    machine.reporter.advance()
    clock.now += 100
    machine.reporter.stage("rendering", 10)
    clock.now += 2
    machine.reporter.advance(4)
    assert machine.lines("stage", "done", "rate") == [
        ("preparing heads", 1, machine.lines("rate")[0][0]),
        ("rendering", 4, 2.0),
    ]


def test_the_last_step_is_told_though_no_time_passed(clock: Clock) -> None:
    machine = Machine()
    machine.reporter.stage("rendering", 2)
    machine.reporter.advance(2)
    assert machine.lines("done", "eta_s") == [(2, 0.0)]


def test_lanes_may_report_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine()
    write = machine._file.write

    def in_halves(text: str) -> None:
        """Lets others in between."""
        write(text[:9])
        time.sleep(1e-4)
        write(text[9:])

    monkeypatch.setattr(machine._file, "write", in_halves)
    monkeypatch.setattr(JsonReporter, "INTERVAL_S", 0.0)
    machine.reporter.stage("rendering", 80)
    threads = [
        threading.Thread(target=lambda: [machine.reporter.advance() for _ in range(20)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert machine.lines("done") == [(k,) for k in range(1, 81)]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals end the work with one exception, and leave time to clean up."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator

import pytest

from generator.execution.stopping import SIGNALS, Stopped, stoppable


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    """Whatever a test does to signals is undone."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_signal_stops_the_work_and_is_told(number: signal.Signals, code: int) -> None:
    with pytest.raises(Stopped, match=f"stopped by {number.name}") as stopped, stoppable():
        signal.raise_signal(number)
    assert stopped.value.exit_code == code
    assert not isinstance(stopped.value, Exception), "no handler of errors swallows it"


def test_later_signals_do_not_disturb_the_cleaning_up() -> None:
    cleaned = []
    with pytest.raises(Stopped, match="SIGTERM"), stoppable():
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            for number in SIGNALS:
                signal.raise_signal(number)
            cleaned.append(True)
    assert cleaned


def test_handlers_are_those_of_before() -> None:
    def ours(*_: object) -> None: ...

    signal.signal(signal.SIGTERM, ours)
    interrupt = signal.getsignal(signal.SIGINT)
    with stoppable():
        assert signal.getsignal(signal.SIGTERM) is not ours
    assert signal.getsignal(signal.SIGTERM) is ours
    with pytest.raises(Stopped), stoppable():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGTERM) is ours
    assert signal.getsignal(signal.SIGINT) is interrupt


def test_what_was_ignored_stays_so() -> None:
    """Under nohup a build outlives its terminal."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with stoppable():
        signal.raise_signal(signal.SIGHUP)
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_it_reaches_a_main_thread_that_waits_for_another() -> None:
    """As a build waits for its lanes."""
    done = threading.Event()
    threading.Timer(0.05, lambda: signal.pthread_kill(threading.main_thread().ident, signal.SIGTERM)).start()
    with pytest.raises(Stopped), stoppable():
        done.wait(20)
    assert not done.is_set()

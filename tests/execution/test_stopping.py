# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals end the work with one exception, and leave time to clean up."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

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


SWALLOWS = """
import os, signal
try:
    os.kill(os.getpid(), signal.{0})
    for _ in range(1000):
        pass
except BaseException as error:
    print("swallowed", flush=True)  # as a library that does without what it could not import
"""
DELETED = "class Odd:\n    def __del__(self):\n        os.kill(os.getpid(), signal.SIGINT)\nOdd()\n"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import odd", "stopped by SIGINT"),
        ("import odd\nimport json", "stopped by SIGINT"),
        ("import odd\nimport term", "stopped by SIGTERM"),
        (DELETED, "stopped by SIGINT"),
    ],
)
def test_none_is_lost_in_an_import(tmp_path: Path, code: str, said: str) -> None:
    (tmp_path / "odd.py").write_text(SWALLOWS.format("SIGINT"))
    (tmp_path / "term.py").write_text(SWALLOWS.format("SIGTERM"))
    lines = "".join(f"        {line}\n" for line in code.splitlines())
    program = (
        "import os, signal, time\nfrom generator.execution.stopping import Stopped, stoppable\n"
        f"signal.signal(signal.SIGINT, signal.default_int_handler)\ntry:\n    with stoppable():\n{lines}"
        "        time.sleep(20)\nexcept Stopped as error:\n    print(error)\n"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=15,
    )
    assert done.stdout.strip() == said, done.stdout + done.stderr


def test_one_that_waits_at_the_end_counts() -> None:
    """The work is done before the import's end was looked for again."""
    with pytest.raises(Stopped, match="SIGTERM"), stoppable():
        exec(compile("import signal; signal.raise_signal(signal.SIGTERM)", "<frozen importlib x>", "exec"))


@pytest.mark.skipif(sys.platform == "win32", reason="no such terminals")
@pytest.mark.parametrize("heard", ["the signal", "the broken terminal"])
def test_a_closed_terminal_is_129(heard: str) -> None:
    import pty

    program = (
        "import signal, sys, time\nfrom generator.execution.stopping import SIGNALS, Stopped, stoppable\n"
        "try:\n    with stoppable():\n"
        + ("        signal.signal(signal.SIGHUP, lambda *_: None)\n" if heard != "the signal" else "")
        + "        while True:\n            print('at work', flush=True)\n            time.sleep(0.01)\n"
        "except Stopped as stopped:\n    print(stopped)\n    sys.exit(stopped.exit_code)\n"
    )
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", program])
    assert b"at work" in os.read(terminal, 1000)
    os.close(terminal)
    deadline = time.monotonic() + 20
    while (ended := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < deadline:
        time.sleep(0.02)
    if ended[0] == 0:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert ended[0] == child and os.waitstatus_to_exitcode(ended[1]) == 129

# SPDX-License-Identifier: GPL-3.0-or-later
"""A child that answers, dies, hangs, talks rubbish or does not want to go."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from generator.errors import HeadError, UsageError, WorkerError
from generator.execution.lanes import lane_process, lines
from generator.execution.lanes.lane_process import LaneProcess
from generator.execution.lanes.lines import LOG_END_LINES, LineProcess
from generator.execution.lanes.options import LaneOptions
from generator.messages import Versions, VersionsOrder
from generator.process import is_running

SOON_S = 10.0
"""Within which anything here ends, also on a busy machine."""

ECHO = """
for line in sys.stdin:
    sys.stdout.write(line)
    sys.stdout.flush()
"""


class Children:
    """Starts children, and ends those that are left."""

    def __init__(self, log: Path) -> None:
        self._log, self._started = log, list[LineProcess]()

    def __call__(self, program: str, **environment: str) -> LineProcess:
        code = f"import json, os, signal, sys, time\n{program}"
        command = [sys.executable, "-S", "-E", "-c", code]
        self._started.append(LineProcess(command, self._log, environment))
        return self._started[-1]

    def end(self) -> None:
        """Kill them all."""
        for child in self._started:
            child.kill()


@pytest.fixture
def child(tmp_path: Path) -> Iterator[Children]:
    """Starts a program as a child."""
    children = Children(tmp_path / "log")
    yield children
    children.end()


def test_it_takes_and_gives_lines(child: Children) -> None:
    echo = child(ECHO)
    for message in ({"a": 1}, {"text": "Zoë\n\u2028 \x00 😀"}, {"long": "x" * 300_000}):
        echo.send(message)
        assert echo.receive(SOON_S) == message
    assert is_running(echo.pid)
    echo.close()
    assert not is_running(echo.pid)


def test_answers_wait_until_they_are_asked_for(child: Children) -> None:
    echo = child(ECHO)
    for number in range(100):
        echo.send({"n": number})
    assert [echo.receive(SOON_S)["n"] for _ in range(100)] == [*range(100)]


def test_it_gets_the_environment_it_needs(child: Children, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OURS", "kept")
    told = child("print(json.dumps([os.environ['OURS'], os.environ['MORE'], os.getsid(0)]))", MORE="given")
    assert told.receive(SOON_S) == ["kept", "given", told.pid], (
        "in a session of its own: Ctrl-C is not for it"
    )


def test_one_that_ends_says_how_and_what_it_printed(child: Children) -> None:
    dead = child("for k in range(30): print('line', k, file=sys.stderr)\nsys.exit(7)")
    for _ in range(2):  # whoever asks again gets the same answer
        with pytest.raises(
            WorkerError, match=r"ended with exit code 7: line 27 \| line 28 \| line 29$"
        ) as error:
            dead.receive(SOON_S)
    assert error.value.log.splitlines() == [f"line {k}" for k in range(30 - LOG_END_LINES, 30)]


def test_one_that_ends_without_a_word(child: Children) -> None:
    with pytest.raises(WorkerError, match="ended with exit code 0: it printed nothing"):
        child("").receive(SOON_S)


def test_one_that_is_killed_says_by_what(child: Children) -> None:
    killed = child("time.sleep(600)")
    os.kill(killed.pid, signal.SIGSEGV)
    with pytest.raises(WorkerError, match=rf"was killed by signal {signal.SIGSEGV.value}:"):
        killed.receive(SOON_S)


def test_answers_of_one_that_has_ended_still_count(child: Children) -> None:
    last_words = child("print('{\"n\": 1}')\nprint('{\"n\": 2}')")
    assert [last_words.receive(SOON_S), last_words.receive(SOON_S)] == [{"n": 1}, {"n": 2}]
    with pytest.raises(WorkerError, match="ended with exit code 0"):
        last_words.receive(SOON_S)


def test_half_an_answer_is_none(child: Children) -> None:
    with pytest.raises(WorkerError, match="ended with exit code 3"):
        child("sys.stdout.write('{\"n\": 1}')\nsys.stdout.flush()\nos._exit(3)").receive(SOON_S)


def test_an_order_for_one_that_has_ended(child: Children) -> None:
    dead = child("sys.exit(7)")
    with pytest.raises(WorkerError, match="ended with exit code 7"):
        for _ in range(1000):  # the pipe takes some
            dead.send({"fill": "x" * 1000})


def test_one_that_hangs_is_ended_at_its_deadline(child: Children) -> None:
    hung = child("print('still here', file=sys.stderr, flush=True)\ntime.sleep(600)")
    start = time.monotonic()
    with pytest.raises(WorkerError, match="hung: no sign of life for 1 s, so it was ended") as error:
        hung.receive(0.6)
    assert 0.6 <= time.monotonic() - start < SOON_S
    assert not is_running(hung.pid)
    assert error.value.log == "still here"


def test_a_deadline_is_for_each_answer(child: Children) -> None:
    slow = child("for k in range(4):\n    time.sleep(0.2)\n    print(k, flush=True)")
    assert [slow.receive(5.0) for _ in range(4)] == [0, 1, 2, 3]


@pytest.mark.parametrize("rubbish", ["hello", "{'a': 1}", "", "Blender 4.5.0 (hash abc)"])
def test_rubbish_is_a_broken_worker(child: Children, rubbish: str) -> None:
    with pytest.raises(WorkerError, match="answered with something that is not JSON") as error:
        child(f"print({rubbish!r}, flush=True)\ntime.sleep(600)").receive(SOON_S)
    assert len(str(error.value)) < 200


def test_one_that_closes_its_output_and_lives_on_is_ended(
    child: Children, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "ENDING_S", 0.2)
    mute = child("os.close(1)\ntime.sleep(600)")
    with pytest.raises(WorkerError, match="closed its output and did not end, so it was ended"):
        mute.receive(SOON_S)
    assert not is_running(mute.pid)


def test_one_that_outlives_its_closing_is_killed(child: Children) -> None:
    stubborn = child("signal.signal(signal.SIGTERM, signal.SIG_IGN)\nprint(1, flush=True)\ntime.sleep(600)")
    assert stubborn.receive(SOON_S) == 1
    start = time.monotonic()
    stubborn.close(timeout=0.3)
    assert 0.3 <= time.monotonic() - start < SOON_S
    assert not is_running(stubborn.pid)


def test_one_that_ends_in_time_is_not_killed(child: Children, tmp_path: Path) -> None:
    tidy = child("sys.stdin.read()\ntime.sleep(0.2)\nprint('tidied up', file=sys.stderr)")
    tidy.close()
    assert (tmp_path / "log").read_text() == "tidied up\n"


def test_closing_and_killing_what_has_ended_does_no_harm(child: Children) -> None:
    dead = child("")
    dead.close()
    dead.kill()
    dead.close()
    with pytest.raises(WorkerError, match="ended with exit code 0"):
        dead.send({})


def test_what_cannot_be_started_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(WorkerError, match="cannot start /nowhere/blender: No such file"):
        LineProcess(["/nowhere/blender"], tmp_path / "log")


def test_the_log_of_several_is_one_file(child: Children, tmp_path: Path) -> None:
    for number in range(2):
        child(f"print({number}, file=sys.stderr)").close()
    assert (tmp_path / "log").read_text() == "0\n1\n"


LANE = """
print(json.dumps({"is": "LaneReady", "pid": os.getpid()}), flush=True)
options = json.loads(sys.stdin.readline())
for line in sys.stdin:
    for answer in ANSWERS:
        print(json.dumps(answer), flush=True)
"""


@pytest.fixture
def lane(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list]:
    """Answers that a lane process gives to each order, to be filled in."""
    answers: list = []
    started: list[LaneProcess] = []

    def start() -> LaneProcess:
        program = f"import json, os, sys\nANSWERS = {answers!r}\n{LANE}"
        command = [sys.executable, "-S", "-E", "-c", program]
        monkeypatch.setattr(lane_process, "LineProcess", lambda _, log: LineProcess(command, log))
        started.append(LaneProcess(LaneOptions(scratch=str(tmp_path))))
        return started[-1]

    yield [answers, start]
    for process in started:
        process.kill()


def test_a_lane_process_tells_of_images_before_its_receipt(lane: list) -> None:
    answers, start = lane
    answers += [{"is": "Progressed"}, {"is": "Progressed"}, {"is": "Versions", "versions": {"a": "1"}}]
    seen: list[None] = []
    process = start()
    for _ in range(2):
        assert process.run(VersionsOrder(), lambda: seen.append(None)) == Versions({"a": "1"})
    assert len(seen) == 4


@pytest.mark.parametrize("kind", [HeadError, UsageError, WorkerError])
def test_a_failure_is_the_error_that_it_was(lane: list, kind: type[Exception]) -> None:
    answers, start = lane
    answers.append({"is": "LaneFailed", "reason": "it broke", "kind": kind.__name__, "log": "the log"})
    with pytest.raises(kind, match="it broke") as error:
        start().run(VersionsOrder(), lambda: None)
    assert getattr(error.value, "log", "the log") == "the log"


@pytest.mark.parametrize(
    "answer",
    [3, None, [], "text", {}, {"is": "Versions"}, {"is": "Nonsense"}, {"is": "Progressed", "more": 1}],
    ids=str,
)
def test_json_that_is_no_message_is_a_broken_worker(lane: list, answer: object) -> None:
    answers, start = lane
    answers.append(answer)
    with pytest.raises(WorkerError, match="no message"):
        start().run(VersionsOrder(), lambda: None)

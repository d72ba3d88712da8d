# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions to the host and what becomes of the answers, with a server that is none."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from blender_addon.core.conversation import Conversation, Question
from blender_addon.core.host import Host, HostFacts, HostMissing
from blender_addon.core.process import HostProcess
from blender_addon.core.state import State
from generator.errors import WorkerError

HOST = Host(("headturn",), "PATH")
FACTS = HostFacts("1", "3.11", "4.5", "0.10", "21", None)
ECHO = """
import json, sys
for line in sys.stdin:
    asked = json.loads(line)
    if asked["op"] == "die":
        sys.exit("Traceback\\nout of memory")
    answer = {"error": "no such head"} if asked["op"] == "fail" else {"said": asked["op"]}
    print(json.dumps(answer), flush=True)
"""


class Server:
    """Answers when the test says so."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.answers: list[dict[str, Any]] = []
        self.exit_code: int | None = None
        self.closed = False

    def send(self, message: dict[str, Any]) -> None:
        if self.exit_code is not None:
            raise WorkerError("the host ended: gone")
        self.asked.append(message)

    def poll(self) -> list[dict[str, Any]]:
        answers, self.answers = self.answers, []
        return answers

    def last_words(self) -> str:
        return "out of memory"

    def close(self) -> None:
        self.closed = True


class Talk:
    """A conversation, its servers, and what it told of itself."""

    def __init__(self, facts: HostFacts = FACTS, problem: str = "") -> None:
        self.state = State()
        self.servers: list[Server] = []
        self.changes, self.due, self.looks = 0, 0, 0
        self.facts, self.problem = facts, problem
        self.went_on = threading.Event()
        self.went_on.set()
        self.conversation = Conversation(self.state, self._start, self._on_change, self._on_due)
        self.got: list[Any] = []

    def look(self) -> tuple[Host, HostFacts]:
        self.looks += 1
        self.went_on.wait(10)
        if self.problem:
            raise HostMissing(self.problem)
        return HOST, self.facts

    def ask(self, op: str, busy: str = "working...") -> None:
        self.conversation.request({"op": op}, busy, self.got.append, self.look)

    def poll_until(self, true: Callable[[], object]) -> None:
        deadline = time.monotonic() + 10
        while not true():
            assert time.monotonic() < deadline
            self.conversation.poll()
            time.sleep(0.001)

    def answer(self, **answer: Any) -> bool:
        self.servers[-1].answers.append(answer)
        return self.conversation.poll()

    def _start(self) -> Server:
        self.servers.append(Server())
        return self.servers[-1]

    def _on_change(self) -> None:
        self.changes += 1

    def _on_due(self) -> None:
        self.due += 1


def test_a_question_finds_the_host_first_and_waits_for_its_answer() -> None:
    talk = Talk()
    talk.went_on.clear()
    talk.ask("list")
    assert talk.due == 1 and talk.conversation.poll() and talk.conversation.is_busy
    assert talk.conversation.busy == "looking for Headturn..." and not talk.servers
    talk.went_on.set()
    talk.poll_until(lambda: talk.servers)
    assert (talk.state.host, talk.state.facts) == (HOST, FACTS)
    assert talk.conversation.busy == "working..." and talk.servers[0].asked == [{"op": "list"}]
    assert talk.conversation.poll() and not talk.got
    assert not talk.answer(heads=3)
    assert talk.got == [{"heads": 3}] and not talk.conversation.is_busy and talk.conversation.busy == ""
    # The next question needs neither another look nor another server.
    talk.ask("place")
    assert talk.looks == 1 and [m["op"] for m in talk.servers[0].asked] == ["list", "place"]


def test_answers_come_in_order_and_one_that_is_an_error_is_said() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    talk.ask("one")
    talk.ask("two")
    assert talk.conversation.poll() and talk.answer(error="no such head")
    assert talk.state.error == "no such head" and talk.changes > 0
    assert not talk.answer(n=2) and talk.got == [{"n": 2}]
    talk.ask("three")
    assert talk.state.error == "", "a new question clears what went wrong before"


def test_without_a_host_the_panel_says_why() -> None:
    talk = Talk(problem="no Python with Headturn was found")
    talk.ask("list")
    talk.poll_until(lambda: talk.state.error)
    assert talk.state.error == talk.state.host_error == "no Python with Headturn was found"
    assert not talk.servers and not talk.conversation.poll() and not talk.state.checking
    # Nothing is remembered: it is looked for again.
    talk.problem = ""
    talk.ask("list")
    talk.poll_until(lambda: talk.servers)
    assert talk.looks == 2 and talk.state.host_error == ""


def test_a_host_that_lacks_something_is_no_host() -> None:
    talk = Talk(HostFacts("1", "3.11", None, None, "21", None))
    talk.ask("list")
    talk.poll_until(lambda: talk.state.error)
    assert "mediapipe missing" in talk.state.host_error and talk.state.facts is None and not talk.servers


def test_what_an_earlier_look_found_is_late() -> None:
    talk = Talk()
    talk.went_on.clear()
    talk.ask("list")
    talk.conversation.forget_host()
    assert not talk.state.checking
    talk.went_on.set()
    time.sleep(0.05)
    talk.conversation.poll()
    assert talk.state.facts is None and not talk.servers


def test_what_can_wait_is_asked_one_by_one_while_nothing_else_is() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    reasons: list[str] = []
    talk.ask("place")
    later = [Question({"op": f"thumbnail {k}"}, talk.got.append, reasons.append) for k in range(3)]
    talk.conversation.ask_later(later)
    talk.conversation.poll()
    asked = talk.servers[0].asked
    assert [m["op"] for m in asked] == ["place"]
    assert talk.answer(n=0) and [m["op"] for m in asked] == ["place", "thumbnail 0"]
    assert not talk.conversation.is_busy, "nobody waits for a picture"
    talk.ask("step")  # somebody does: it is the next
    assert talk.answer(error="no face") and reasons == ["no face"] and talk.state.error == ""
    assert len(asked) == 3 and talk.answer(n=1) and asked[-1]["op"] == "thumbnail 1"
    talk.conversation.ask_later(())
    assert not talk.answer(n=2)
    assert talk.got == [{"n": 0}, {"n": 1}, {"n": 2}] and len(asked) == 4


def test_a_server_that_dies_is_said_and_replaced() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    talk.ask("place")
    talk.servers[0].exit_code = 1
    assert not talk.conversation.poll()
    assert talk.state.error == "the host ended: out of memory" and not talk.conversation.is_busy
    assert talk.servers[0].closed
    talk.ask("place")
    assert len(talk.servers) == 2 and talk.conversation.is_busy


def test_a_server_that_cannot_start_is_said() -> None:
    def start() -> Server:
        raise WorkerError("cannot start headturn: permission denied")

    state = State(facts=FACTS)
    conversation = Conversation(state, start, lambda: None, lambda: None)
    conversation.request({"op": "list"}, "", lambda answer: None, lambda: (HOST, FACTS))
    assert "permission denied" in state.error and not conversation.poll()


def test_an_answer_may_end_the_conversation() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    talk.conversation.request({"op": "a"}, "", lambda answer: talk.conversation.close(), talk.look)
    talk.ask("b")
    talk.servers[0].answers = [{}, {}]
    assert not talk.conversation.poll() and talk.servers[0].closed and not talk.got


def test_a_real_process() -> None:
    state = State(facts=FACTS)
    got: list[Any] = []
    started: list[HostProcess] = []

    def start() -> HostProcess:
        started.append(HostProcess([sys.executable, "-c", ECHO]))
        return started[-1]

    conversation = Conversation(state, start, lambda: None, lambda: None)

    def ask(op: str) -> None:
        conversation.request({"op": op}, "working...", got.append, lambda: (HOST, FACTS))
        deadline = time.monotonic() + 20
        while conversation.poll() and time.monotonic() < deadline:
            time.sleep(0.005)

    ask("list")
    assert got == [{"said": "list"}]
    ask("fail")
    assert state.error == "no such head"
    ask("die")
    assert state.error == "the host ended: out of memory"
    ask("again")
    assert got[-1] == {"said": "again"} and len(started) == 2
    conversation.close()
    assert started[-1].exit_code == 0


@pytest.mark.parametrize("what", ["SUBJECT", "EXPRESSION"])
def test_stepping_goes_around_the_end(what: str) -> None:
    state = State(heads=[("anna", "smile"), ("anna", "neutral"), ("bert", "smile")])
    assert state.subjects() == ["anna", "bert"] and state.expressions("anna") == ["smile", "neutral"]
    assert state.first_of("anna") == "neutral" and state.first_of("bert") == "smile"
    expected = {"SUBJECT": ("bert", "smile"), "EXPRESSION": ("anna", "neutral")}[what]
    assert state.beside(("anna", "smile"), what, 1) == state.beside(("anna", "smile"), what, -1) == expected
    assert state.beside(("gone", "smile"), "SUBJECT", 1) == ("anna", "neutral")


def test_answers_change_what_is_known() -> None:
    state = State(displayed=("old", "neutral"), error="")
    listed = [{"subject": "a", "expression": "neutral", "problems": []}]
    state.take_list({"kind": "mesh", "heads": listed, "skipped": ["b/neutral: no texture"]})
    assert state.heads == [("a", "neutral")] and state.displayed is None and state.error == ""
    state.take_head(("a", "neutral"), {"notes": ["units guessed"], "vertices": 9, "radius_mm": 1.0})
    assert (state.displayed, state.vertices, state.notes) == (("a", "neutral"), 9, ["units guessed"])
    state.take_extremes([[[0, 0]], None, [[1, 1]]])
    assert state.extremes == "A face was found in 2 of 3"
    state.forget_heads()
    assert not state.heads and not state.skipped and state.displayed == ("a", "neutral")
    state.take_list({"kind": "mesh", "heads": [], "skipped": ["b/neutral: no texture"]})
    assert state.error == "b/neutral: no texture"
    state.take_list({"kind": "mesh", "heads": [], "skipped": []})
    assert state.error == "this source holds no heads"
    state.forget()
    assert state == State()

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
from blender_addon.core.found import Found, Listing, extremes
from blender_addon.core.host import Host, HostFacts, HostMissing
from blender_addon.core.process import HostProcess
from blender_addon.core.state import State
from generator.errors import UsageError, WorkerError

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
    listing = Listing([("anna", "smile"), ("anna", "neutral"), ("bert", "smile")])
    assert listing.subjects() == ["anna", "bert"] and listing.expressions("anna") == ["smile", "neutral"]
    assert listing.first_of("anna") == "neutral" and listing.first_of("bert") == "smile"
    expected = {"SUBJECT": ("bert", "smile"), "EXPRESSION": ("anna", "neutral")}[what]
    beside = [listing.beside(("anna", "smile"), what, by) for by in (1, -1)]
    assert beside == [expected, expected]
    assert listing.beside(("gone", "smile"), "SUBJECT", 1) == ("anna", "neutral")


def test_a_list_says_why_there_is_nothing() -> None:
    listed = [{"subject": "a", "expression": "neutral", "problems": []}]
    listing = Listing.of({"kind": "mesh", "heads": listed, "skipped": ["b/neutral: no texture"]})
    assert listing == Listing([("a", "neutral")], ["b/neutral: no texture"]) and listing.problem == ""
    assert Listing([], ["b/neutral: no texture"]).problem == "b/neutral: no texture"
    assert Listing().problem == "this source holds no heads"
    assert extremes([[[0, 0]], None, [[1, 1]]]) == "A face was found in 2 of 3"


def test_progress_is_shown_until_the_answer_comes() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    talk.ask("list")
    told = {"stage": "making heads", "total": 20}
    assert talk.answer(event="stage", **told) and talk.conversation.busy == "making heads 0 of 20"
    assert talk.answer(event="progress", done=5, rate=2.0, eta_s=7.5, **told)
    assert talk.conversation.busy == "making heads 5 of 20 · 2.0/s · 0:08 left"
    assert talk.conversation.progress.share == 0.25 and not talk.got
    assert not talk.answer(heads=3) and talk.got == [{"heads": 3}] and talk.conversation.progress.total == 0


def test_nobody_waits_once_another_file_is_open() -> None:
    talk = Talk()
    talk.state.facts = FACTS
    talk.ask("list")
    talk.conversation.ask_later([Question({"op": "thumbnail"}, talk.got.append, talk.got.append)])
    busy = talk.servers[0]
    busy.answers = [{"heads": 3}]
    talk.conversation.drop()
    assert not talk.conversation.poll() and not talk.got and not talk.conversation.is_busy
    talk.poll_until(lambda: busy.closed)
    talk.ask("list")
    assert len(talk.servers) == 2 and not talk.answer(heads=4) and talk.got == [{"heads": 4}]
    # A server that nobody waits for goes on.
    talk.conversation.drop()
    talk.ask("place")
    assert len(talk.servers) == 2


def test_what_waits_for_the_host_is_not_asked_for_another_file() -> None:
    talk = Talk()
    talk.went_on.clear()
    built: list[str] = []
    talk.ask("list")
    talk.conversation.with_host(lambda: built.append("a build outlives the file"), talk.look)
    talk.conversation.drop()
    talk.went_on.set()
    talk.poll_until(lambda: built)
    assert not talk.servers and not talk.conversation.is_busy


def test_the_host_can_be_waited_for() -> None:
    talk = Talk()
    talk.conversation.find_now(talk.look)
    talk.conversation.find_now(talk.look)
    assert talk.looks == 1 and talk.state.facts == FACTS
    lacking = Talk(HostFacts("1", "3.11", None, None, "21", None))
    with pytest.raises(UsageError, match="mediapipe missing"):
        lacking.conversation.find_now(lacking.look)


def test_a_list_goes_with_the_file() -> None:
    listing = Listing([("anna", "neutral"), ("Lee, Perry", "smile")], ["b/neutral: no texture"])
    text = listing.text("source")
    assert Listing.read(text, "source") == listing
    assert Listing.read(text, "another") is None and Listing.read("", "source") is None


def test_what_was_found_counts_for_its_key() -> None:
    found: Found[str] = Found(kept=2)
    assert found.of("a") is None
    for key in ("a", "b", "a", "c"):
        found.take(key, f"of {key}")
    assert [found.of(key) for key in "abc"] == ["of a", None, "of c"], "the newest are kept"
    state = State(facts=FACTS, error="no face")
    state.extremes.take("a", "9 of 9")
    state.extremes.take("b", "8 of 9")
    assert state.extremes.of("a") is None, "there is one picture"
    state.forget()
    assert state.extremes.of("b") is None and (state.facts, state.error) == (None, "")

# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked of the host, and what it answers. Nothing here waits: whoever has a clock calls poll."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from generator.errors import HeadturnError, UsageError

from .progress import Progress
from .state import State

if TYPE_CHECKING:
    from .host import Host, HostFacts

OnAnswer = Callable[[dict[str, Any]], None]
Look = Callable[[], "tuple[Host, HostFacts]"]
"""Finds and checks the host. It runs in a thread of its own. Raises HeadturnError."""


class Server(Protocol):
    """The preview server, see :class:`blender_addon.core.process.HostProcess`."""

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        ...

    def send(self, message: dict[str, Any]) -> None:
        """One request. Raises WorkerError."""
        ...

    def poll(self) -> list[dict[str, Any]]:
        """The answers that came since the last call."""
        ...

    def last_words(self) -> str:
        """Why it ended."""
        ...

    def close(self) -> None:
        """End it."""
        ...


@dataclass(frozen=True)
class Question:
    """A line for the preview server, and who takes the answer, or the reason why there is none.

    busy: what the panel says until the answer comes; None if nobody waits for it.
    """

    message: dict[str, Any]
    on_answer: OnAnswer
    on_error: Callable[[str], None]
    busy: str | None = None


class Conversation:
    """Questions, one after another, to one preview server that starts with the first of them.

    state: gets what went wrong, and the host that was found. start: starts the server on that host;
    raises HeadturnError. on_change: something that the panel shows is different. on_due: from now on poll is
    to be called until it says that nothing is due. progress: how far the answer is that is due.
    """

    def __init__(
        self,
        state: State,
        start: Callable[[], Server],
        on_change: Callable[[], None],
        on_due: Callable[[], None],
    ) -> None:
        self.state = state
        self._start, self._on_change, self._on_due = start, on_change, on_due
        self._server: Server | None = None
        self.progress = Progress()
        self._waiting: deque[Question] = deque()
        self._later: deque[Question] = deque()
        self._found: deque[Callable[[], None]] = deque()
        self._file = 0  # how often another file was opened; what was asked for an earlier one is nobody's
        self._looked = 0  # how often the host was looked for anew; what an earlier look finds is late

    def request(self, message: dict[str, Any], busy: str, on_answer: OnAnswer, look: Look) -> None:
        """Ask, once there is a host; on_answer gets what it said, out of :meth:`poll`.

        A reason why it cannot is shown in the panel.
        """
        self.state.error = ""
        file = self._file

        def ask() -> None:
            if file == self._file:
                self._ask(Question(message, on_answer, self.fail, busy))

        self.with_host(ask, look)

    def ask_later(self, questions: Iterable[Question]) -> None:
        """What to ask, one by one, while nothing else is asked; in place of what was to be asked before."""
        self._later.clear()
        self._later.extend(questions)
        if self._later and self.state.facts is not None:
            self._on_due()

    def with_host(self, then: Callable[[], None], look: Look) -> None:
        """Find the host, once; call then if it is usable."""
        state, looked = self.state, self._looked
        if state.facts is not None:
            then()
            return
        state.checking, state.host_error = True, ""

        def find() -> None:
            try:
                host, facts = look()
            except HeadturnError as error:
                problem = str(error)
                self._found.append(lambda: finish(None, None, problem))
            else:
                self._found.append(lambda: finish(host, facts, facts.problem))

        def finish(host: Host | None, facts: HostFacts | None, problem: str) -> None:
            if looked != self._looked:
                return
            state.checking = False
            state.host, state.facts, state.host_error = host, facts if not problem else None, problem
            if problem:
                self.fail(problem)
            else:
                then()

        threading.Thread(target=find, daemon=True).start()
        self._on_due()

    def find_now(self, look: Look) -> None:
        """Find the host and wait for it. Raises HeadturnError."""
        if self.state.facts is None:
            host, facts = look()
            if facts.problem:
                raise UsageError(facts.problem)
            self.state.host, self.state.facts = host, facts

    def poll(self) -> bool:
        """Take in what came, ask what is next. True while something is due."""
        while self._found:
            self._found.popleft()()
            self._on_change()
        server = self._server
        if server is not None and self._waiting:
            self._take(server)
        if self._later and not self._waiting and not self.state.checking:
            self._ask(self._later.popleft())
        return bool(self._waiting or self.state.checking or self._found)

    def fail(self, message: str) -> None:
        """Something went wrong: the panel says it."""
        self.state.error = message
        self._on_change()

    @property
    def is_busy(self) -> bool:
        """Is an answer due that somebody waits for?"""
        return self.state.checking or any(question.busy is not None for question in self._waiting)

    @property
    def busy(self) -> str:
        """What is going on, for the panel; empty if nobody needs to know."""
        if self.state.checking:
            return "looking for Headturn..."
        if self.progress.total:
            return self.progress.line()
        return next((question.busy for question in self._waiting if question.busy), "")

    def forget_host(self) -> None:
        """Another host is named: what was found no longer counts."""
        self.close()
        self._looked += 1
        self.state.checking = False
        self.state.host, self.state.facts, self.state.host_error = None, None, ""

    def drop(self) -> None:
        """Nobody waits for answers any more: another file is opened, or somebody has had enough.

        A host that is busy with one is ended meanwhile; the next question starts another. A look for the
        host goes on: a build may be waiting for it.
        """
        self._file += 1
        self._later.clear()
        if self._waiting and self._server is not None:
            threading.Thread(target=self._server.close, daemon=True).start()
            self._server = None
        self._waiting.clear()
        self.progress = Progress()
        self._on_change()

    def close(self) -> None:
        """End the preview server; nothing that was asked will be answered."""
        self._waiting.clear()
        self._later.clear()
        self._end_server()

    def _ask(self, question: Question) -> None:
        try:
            if self._server is not None and self._server.exit_code is not None:
                self._end_server()
            if self._server is None:
                self._server = self._start()
            self._server.send(question.message)
        except HeadturnError as error:
            self.fail(str(error))
            return
        self._waiting.append(question)
        self._on_due()

    def _take(self, server: Server) -> None:
        for answer in server.poll():
            if not self._waiting:  # an answer led to the end of the conversation
                return
            if "event" in answer:
                self.progress.take(answer)
                self._on_change()
                continue
            self.progress = Progress()
            question = self._waiting.popleft()
            if "error" in answer:
                question.on_error(answer["error"])
            else:
                question.on_answer(answer)
            self._on_change()
        if self._waiting and server.exit_code is not None:
            self._waiting.clear()
            self._later.clear()
            self.fail(f"the host ended: {server.last_words()}")
            self._end_server()

    def _end_server(self) -> None:
        self.progress = Progress()
        if self._server is not None:
            self._server.close()
            self._server = None

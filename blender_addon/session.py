# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs beside Blender: the host that was found, its preview server, and what they said.

Nothing here blocks: questions go out, and a timer of 0.1 s, which runs only
while an answer is due, takes the answers in.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    from .core.host import Host, HostFacts
    from .core.process import HostProcess

TICK_S = 0.1
OnAnswer = Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class Question:
    """A line for the preview server, and who takes the answer, or the reason why there is none.

    busy: what the panel says until the answer comes; None if nobody waits for it.
    """

    message: dict[str, Any]
    on_answer: OnAnswer
    on_error: Callable[[str], None]
    busy: str | None = None


@dataclass
class State:
    """Shown by the panel; not saved with the file."""

    host: Host | None = None
    facts: HostFacts | None = None
    host_error: str = ""
    checking: bool = False
    error: str = ""
    kind: str = ""
    heads: list[tuple[str, str]] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    vertices: int = 0
    displayed: tuple[str, str] | None = None
    extremes: str = ""
    landmarks: tuple[tuple[float, ...], list[list[float]] | None] | None = None

    def subjects(self) -> list[str]:
        """Subjects in the source's order."""
        return list(dict.fromkeys(subject for subject, _ in self.heads))

    def expressions(self, subject: str) -> list[str]:
        """Expressions of a subject."""
        return [expression for name, expression in self.heads if name == subject]


state = State()
_server: HostProcess | None = None
_waiting: deque[Question] = deque()
_later: deque[Question] = deque()
_found: deque[Callable[[], None]] = deque()
_quiet: list[None] = []


@contextmanager
def quiet() -> Iterator[None]:
    """Settings changed in here do not act one by one."""
    _quiet.append(None)
    try:
        yield
    finally:
        _quiet.pop()


def is_quiet() -> bool:
    """Are settings being changed that should not act?"""
    return bool(_quiet)


def request(message: dict[str, Any], busy: str, on_answer: OnAnswer) -> None:
    """Ask the preview server; on_answer gets what it said, later, in Blender's main thread.

    A reason why it cannot is shown in the panel.
    """
    state.error = ""
    with_host(lambda: _ask(Question(message, on_answer, _fail, busy)))


def ask_later(questions: Iterable[Question]) -> None:
    """What to ask, one by one, while nothing else is asked; in place of what was to be asked before."""
    _later.clear()
    _later.extend(questions)
    if _later and state.facts is not None:
        _start_ticking()


def _ask(question: Question) -> None:
    global _server
    from .core.errors import HeadturnError
    from .core.host import host_command
    from .core.process import HostProcess

    try:
        if _server is None or _server.exit_code is not None:
            command = host_command(state.host, state.facts, ["preview-server"], bpy.app.binary_path)
            _server = HostProcess(command)
        _server.send(question.message)
    except HeadturnError as error:
        _fail(str(error))
        return
    _waiting.append(question)
    _start_ticking()


def with_host(then: Callable[[], None], *, beside: Path | None = None) -> None:
    """Find and check the host, once, without waiting; call then if it is usable."""
    from .core.errors import HeadturnError
    from .core.host import check_host, find_host
    from .preferences import host_preference

    if state.facts is not None:
        then()
        return
    preference, blend = host_preference(), bpy.data.filepath
    beside = beside or (Path(blend).parent if blend else None)
    state.checking, state.host_error = True, ""

    def look() -> None:
        try:
            host = find_host(preference, beside)
            facts = check_host(host)
        except HeadturnError as error:
            problem = str(error)
            _found.append(lambda: finish(None, None, problem))
        else:
            _found.append(lambda: finish(host, facts, facts.problem))

    def finish(host: Host | None, facts: HostFacts | None, problem: str) -> None:
        state.checking = False
        state.host, state.facts, state.host_error = host, facts if not problem else None, problem
        if problem:
            _fail(problem)
        else:
            then()

    threading.Thread(target=look, daemon=True).start()
    _start_ticking()


def forget_host() -> None:
    """The preference changed: what was found no longer counts."""
    close()
    state.host, state.facts, state.host_error = None, None, ""


def close() -> None:
    """End the preview server; nothing that was asked will be answered."""
    global _server
    _waiting.clear()
    _later.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _server is not None:
        _server.close()
        _server = None


def forget() -> None:
    """The extension is disabled: what was found no longer counts."""
    close()
    state.__init__()  # type: ignore[misc]


def is_busy() -> bool:
    """Is an answer due that somebody waits for?"""
    return state.checking or any(question.busy is not None for question in _waiting)


def busy() -> str:
    """What is going on, for the panel; empty if nobody needs to know."""
    if state.checking:
        return "looking for Headturn..."
    return next((question.busy for question in _waiting if question.busy), "")


def redraw() -> None:
    """Redraw what shows words: the sidebars and the preferences. The 3D views stay: they cost most."""
    for area in _areas():
        if area.type == "PREFERENCES":
            area.tag_redraw()
        elif area.type == "VIEW_3D":
            for region in area.regions:
                if region.type == "UI":
                    region.tag_redraw()


def redraw_views() -> None:
    """Redraw the 3D views with all that lies over them."""
    for area in _areas():
        if area.type == "VIEW_3D":
            area.tag_redraw()


def _areas() -> Iterator[bpy.types.Area]:
    for window in bpy.context.window_manager.windows:
        yield from window.screen.areas


def _fail(message: str) -> None:
    state.error = message
    redraw()


def _start_ticking() -> None:
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK_S)
    redraw()


def _tick() -> float | None:
    while _found:
        _found.popleft()()
        redraw()
    if _server is not None and _waiting:
        for answer in _server.poll():
            question = _waiting.popleft()
            if "error" in answer:
                question.on_error(answer["error"])
            else:
                question.on_answer(answer)
            redraw()
        if _waiting and _server.exit_code is not None:
            _waiting.clear()
            _later.clear()
            _fail(f"the host ended: {_server.last_words()}")
    if _later and not _waiting and not state.checking:
        _ask(_later.popleft())
    return TICK_S if _waiting or state.checking or _found else None

# SPDX-License-Identifier: GPL-3.0-or-later
"""The one conversation with the host, and its clock: a timer that runs only while an answer is due."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from generator import __version__

from . import folders, windows
from .core.conversation import Conversation, Look, OnAnswer, Server
from .core.state import State

if TYPE_CHECKING:
    from .core.host import Host, HostFacts

TICK_S = 0.1
"""Seconds between two looks at what the host said."""

Shown = Any
"""scene.headturn: its properties are made when Blender starts, so no type checker knows them."""

_quiet: list[None] = []
_missing: list[bool] = []


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
    conversation.request(message, busy, on_answer, _look())


def with_host(then: Callable[[], None]) -> None:
    """Find and check the host, once, without waiting; call then if it is usable."""
    conversation.with_host(then, _look())


def find_host() -> None:
    """The same, but wait for it. Raises HeadturnError."""
    conversation.find_now(_look())


def host_command(arguments: list[str], *, scene: bool = False) -> list[str]:
    """The command line of the host that was found. scene: it may render one that this Blender saved."""
    from .core.host import host_command

    host, facts = _host()
    saved_by = bpy.app.version[:2] if scene else None
    return host_command(host, facts, arguments, bpy.app.binary_path, saved_by)


def host_preference() -> str:
    """The preference, or "" where the add-on is not enabled as an extension."""
    addon = bpy.context.preferences.addons.get(__package__)
    if addon is None or addon.preferences is None:
        return ""
    return bpy.path.abspath(addon.preferences.python) if addon.preferences.python else ""


def set_up() -> Path | None:
    """The environment that Set Up made for this release; None if there is none, or no extension either."""
    from .core.set_up import is_ready

    try:
        folder = folders.environment()
    except ValueError:  # enabled in a way that extensions are not
        return None
    return folder if is_ready(folder, __version__) else None


def host_is_missing() -> bool:
    """Is there plainly no host? Looked for once, without asking it anything."""
    from .core.host import HostMissing, find_host

    if not _missing:
        try:
            find_host(host_preference(), None, set_up=set_up())
        except HostMissing:
            _missing.append(True)
        else:
            _missing.append(False)
    return _missing[0]


def forget_host() -> None:
    """The preference changed: what was found no longer counts."""
    _stop_ticking()
    _missing.clear()
    conversation.forget_host()


def forget() -> None:
    """The extension is disabled: what was found no longer counts."""
    forget_host()
    state.forget()
    folders.remove_scratch()


def tick() -> float | None:
    """Take in what the host said. For a timer: seconds until the next time, None if nothing is due."""
    return TICK_S if conversation.poll() else None


def _look() -> Look:
    preference, blend, made = host_preference(), bpy.data.filepath, set_up()
    beside = Path(blend).parent if blend else None

    def look() -> tuple[Host, HostFacts]:
        from .core.host import check_host, find_host

        host = find_host(preference, beside, set_up=made)
        return host, check_host(host)

    return look


def _host() -> tuple[Host, HostFacts]:
    assert state.host is not None and state.facts is not None, "the host is looked for first"
    return state.host, state.facts


def _start_server() -> Server:
    from .core.process import HostProcess

    return HostProcess(host_command(["preview-server"], scene=True))


def _start_ticking() -> None:
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=TICK_S, persistent=True)
    windows.redraw()


def _stop_ticking() -> None:
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)


state = State()
conversation = Conversation(state, _start_server, windows.redraw, _start_ticking)

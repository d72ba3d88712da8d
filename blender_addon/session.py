# SPDX-License-Identifier: GPL-3.0-or-later
"""The one conversation with the host, and its clock: a timer that runs only while an answer is due."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import windows
from .core.conversation import Conversation, Look, OnAnswer, Server
from .core.state import State

if TYPE_CHECKING:
    from .core.host import Host, HostFacts

TICK_S = 0.1
"""Seconds between two looks at what the host said."""

Shown = Any
"""scene.headturn: its properties are made when Blender starts, so no type checker knows them."""

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
    conversation.request(message, busy, on_answer, _look())


def with_host(then: Callable[[], None]) -> None:
    """Find and check the host, once, without waiting; call then if it is usable."""
    conversation.with_host(then, _look())


def host_command(arguments: list[str]) -> list[str]:
    """The command line of the host that was found."""
    from .core.host import host_command

    host, facts = _host()
    return host_command(host, facts, arguments, bpy.app.binary_path)


def host_preference() -> str:
    """The preference, or "" where the add-on is not enabled as an extension."""
    addon = bpy.context.preferences.addons.get(__package__)
    if addon is None or addon.preferences is None:
        return ""
    return bpy.path.abspath(addon.preferences.python) if addon.preferences.python else ""


def forget_host() -> None:
    """The preference changed: what was found no longer counts."""
    _stop_ticking()
    conversation.forget_host()


def forget() -> None:
    """The extension is disabled: what was found no longer counts."""
    forget_host()
    state.forget()


def tick() -> float | None:
    """Take in what the host said. For a timer: seconds until the next time, None if nothing is due."""
    return TICK_S if conversation.poll() else None


def _look() -> Look:
    preference, blend = host_preference(), bpy.data.filepath
    beside = Path(blend).parent if blend else None

    def look() -> tuple[Host, HostFacts]:
        from .core.host import check_host, find_host

        host = find_host(preference, beside)
        return host, check_host(host)

    return look


def _host() -> tuple[Host, HostFacts]:
    assert state.host is not None and state.facts is not None, "the host is looked for first"
    return state.host, state.facts


def _start_server() -> Server:
    from .core.process import HostProcess

    return HostProcess(host_command(["preview-server"]))


def _start_ticking() -> None:
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=TICK_S)
    windows.redraw()


def _stop_ticking() -> None:
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)


state = State()
conversation = Conversation(state, _start_server, windows.redraw, _start_ticking)

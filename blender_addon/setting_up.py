# SPDX-License-Identifier: GPL-3.0-or-later
"""Set Up: the host's environment, made in the extension's own folder, and what somebody may type instead."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import ClassVar

import bpy

from . import folders, session, windows
from .core.panel import Line
from .core.set_up import SetUp
from .registration import registering
from .wrapping import label, message

TICK_S = 0.3

current = SetUp()


class SetUpHost(bpy.types.Operator):
    """Make a Python environment for Headturn in the extension's folder: some hundred megabytes are fetched"""

    bl_idname = "headturn.set_up"
    bl_label = "Set Up"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from .core.host import own_wheel

        if current.runs:
            cls.poll_message_set("It is being set up")
            return False
        if session.host_preference():
            cls.poll_message_set("Another Python is named in the preferences: clear that field first")
            return False
        if own_wheel() is None:
            cls.poll_message_set("This is a checkout: make test and make demo set up an environment")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from generator import __version__

        from .core.host import own_wheel
        from .core.pythons import find_python

        session.forget_host()  # what is there may be at work
        wheel = own_wheel()
        assert wheel is not None, "poll looked"
        own = sys.executable
        current.start(folders.environment(), wheel, __version__, lambda: find_python(own))
        if not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick, first_interval=TICK_S, persistent=True)
        windows.redraw()
        return {"FINISHED"}


class CancelSetUp(bpy.types.Operator):
    """End it; Set Up begins anew"""

    bl_idname = "headturn.cancel_set_up"
    bl_label = "Cancel"
    in_menu = "Cancel Set Up"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return current.runs

    def execute(self, context: bpy.types.Context) -> set[str]:
        current.cancel()
        return {"FINISHED"}


class CopyText(bpy.types.Operator):
    """Copy this to the clipboard"""

    bl_idname = "headturn.copy"
    bl_label = "Copy"
    bl_options: ClassVar[set[str]] = {"INTERNAL"}

    text: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})  # type: ignore[valid-type]

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = self.text
        self.report({"INFO"}, "Copied")
        return {"FINISHED"}


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, *, margin: int = 6) -> None:
    """The button, or how far it is, or why it failed."""
    if current.runs:
        message(layout, context, Line(current.line, "SORTTIME"), margin=margin)
        row = layout.row(align=True)
        row.progress(factor=current.share, text=f"{current.share:.0%}")
        row.operator("headturn.cancel_set_up", icon="CANCEL")
        return
    if current.error:
        message(layout, context, Line(current.error, "ERROR"), margin=margin)
        _draw_commands(layout, current.commands)
        if current.log:
            layout.operator(
                "headturn.copy", text="Copy Log", icon="COPYDOWN", translate=False
            ).text = current.log
    elif current.line:
        message(layout, context, Line(current.line, "CHECKMARK"), margin=margin)
    layout.operator("headturn.set_up", icon="IMPORT")


def draw_commands(layout: bpy.types.UILayout) -> None:
    """What does the same by hand, to be copied line by line."""
    from .core.host import install_commands

    label(layout, "Or by hand, and then name that folder above:", "INFO")
    _draw_commands(layout, install_commands())


def _draw_commands(layout: bpy.types.UILayout, commands: Sequence[str]) -> None:
    for command in commands:
        row = layout.row(align=True)
        label(row, command, "BLANK1")
        row.operator("headturn.copy", text="", icon="COPYDOWN").text = command


def close() -> None:
    """Blender ends, or the extension is disabled."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    current.cancel()


def _tick() -> float | None:
    windows.redraw()
    if current.runs:
        return TICK_S
    if not current.error:
        session.forget_host()
        session.with_host(windows.redraw)
    return None


register, _unregister = registering(SetUpHost, CancelSetUp, CopyText)


def unregister() -> None:
    """End what they started, and take them away."""
    close()
    _unregister()

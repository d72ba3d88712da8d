# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes on in the host, with a way out."""

from __future__ import annotations

import bpy

from . import session
from .core import panel
from .registration import registering
from .wrapping import message


class StopWaiting(bpy.types.Operator):
    """Give up what the host is busy with. Heads that are made already need not be made again"""

    bl_idname = "headturn.stop_waiting"
    bl_label = "Cancel"
    in_menu = "Cancel Waiting"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return session.conversation.is_busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.conversation.drop()
        return {"FINISHED"}


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What went wrong last, or what is going on, how far it is, and a button that ends it."""
    conversation = session.conversation
    line = panel.going_on(conversation)
    if line is not None:
        message(layout, context, line)
    if line is None or conversation.state.error or conversation.state.checking:
        return
    row = layout.row(align=True)
    if conversation.progress.total:
        row.progress(factor=conversation.progress.share, text=f"{conversation.progress.share:.0%}")
    row.operator("headturn.stop_waiting", icon="CANCEL")


register, unregister = registering(StopWaiting)

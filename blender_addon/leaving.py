# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that lead back: to the user's own scene, and to a file without anything of ours."""

from __future__ import annotations

from typing import ClassVar

import bpy

from . import own, pictures, selected
from .core.labels import one_line
from .registration import registering


class BackToMyScene(bpy.types.Operator):
    """Show your own scene again, its 3D views as they were. The heads stay, the settings come along"""

    bl_idname = "headturn.leave"
    bl_label = "Back to My Scene"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from . import studio

        if not own.is_own(context.scene):
            cls.poll_message_set("This is your scene")
            return False
        if studio.own_scene(context.scene) is None:
            cls.poll_message_set("There is no other scene in this file")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import studio

        to = studio.own_scene(context.scene)
        assert to is not None, "poll looked"
        studio.leave(context.scene, to)
        return {"FINISHED"}


class RemoveHeadturn(bpy.types.Operator):
    """Take the heads, their scenes, pictures and settings out of this file. Nothing else is touched"""

    bl_idname = "headturn.remove"
    bl_label = "Remove Headturn"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import studio

        pictures.clear()
        for scene in bpy.data.scenes:
            selected.let_go(scene)
        for name in studio.remove():
            self.report({"WARNING"}, one_line(f'the scene "{name}" stays: something of yours is in it'))
        return {"FINISHED"}


register, unregister = registering(BackToMyScene, RemoveHeadturn)

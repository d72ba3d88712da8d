# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that throw the dice. What acts is imported with the first click."""

from __future__ import annotations

from typing import Any

import bpy

from . import own, pictures, session, windows
from .core.looks import SHEET
from .operators import SHEET_COLUMNS, there_is_a_head
from .registration import registering


class _Dice:
    """Blender keeps a button grey for as long as the mouse rests on it, so a throw that comes too early is
    refused when it is made, and the next one needs no other movement of the hand."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return there_is_a_head(cls, context)

    def execute(self: Any, context: bpy.types.Context) -> set[str]:
        if session.conversation.is_busy:
            self.report({"INFO"}, "Wait for what is going on")
            return {"CANCELLED"}
        self.act(context.scene.headturn)
        return {"FINISHED"}

    def act(self, shown: session.Shown) -> None:
        """What the button does."""
        raise NotImplementedError


class RollTheDice(_Dice, bpy.types.Operator):
    """Show a look at the pose in view: lens, light, backdrop and all else that is drawn. What no setting draws is drawn as photographs are"""  # noqa: E501  one tooltip

    bl_idname = "headturn.roll_dice"
    bl_label = "Roll the Dice"

    def act(self, shown: session.Shown) -> None:
        from . import looks

        looks.roll(shown)


class ShowLook(_Dice, bpy.types.Operator):
    """Show the look of this seed at the pose in view"""

    bl_idname = "headturn.show_look"
    bl_label = "Show Look"

    def act(self, shown: session.Shown) -> None:
        from . import looks

        looks.show(shown)


class LookSheet(_Dice, bpy.types.Operator):
    """Show nine looks at the pose in view: of this seed and those after it"""

    bl_idname = "headturn.look_sheet"
    bl_label = "Sheet of Looks"

    def act(self, shown: session.Shown) -> None:
        from . import looks

        looks.sheet(shown, range(shown.look_seed, shown.look_seed + SHEET), SHEET_COLUMNS)


class OpenLooks(bpy.types.Operator):
    """Open the sheet of looks in a window"""

    bl_idname = "headturn.open_looks"
    bl_label = "Open"
    in_menu = "Open Sheet of Looks"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return own.kept(bpy.data.images, pictures.LOOKS) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.open_window("IMAGE_EDITOR", "image", own.kept(bpy.data.images, pictures.LOOKS))
        return {"FINISHED"}


register, unregister = registering(RollTheDice, ShowLook, LookSheet, OpenLooks)

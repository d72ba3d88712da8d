# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that throw the dice. What acts is imported with the first click."""

from __future__ import annotations

import bpy

from . import pictures, windows
from .core.looks import SHEET
from .operators import SHEET_COLUMNS, nothing_is_due, there_is_a_head


class _OfHead:
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return nothing_is_due(cls) and there_is_a_head(cls, context)


class RollTheDice(_OfHead, bpy.types.Operator):
    """Show a look at the pose in view: lens, light, backdrop and all else that is drawn. What no setting draws is drawn as photographs are"""  # noqa: E501  one tooltip

    bl_idname = "headturn.roll_dice"
    bl_label = "Roll the Dice"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import looks

        looks.roll(context.scene.headturn)
        return {"FINISHED"}


class ShowLook(_OfHead, bpy.types.Operator):
    """Show the look of this seed at the pose in view"""

    bl_idname = "headturn.show_look"
    bl_label = "Show Look"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import looks

        looks.show(context.scene.headturn)
        return {"FINISHED"}


class LookSheet(_OfHead, bpy.types.Operator):
    """Show nine looks at the pose in view: of this seed and those after it"""

    bl_idname = "headturn.look_sheet"
    bl_label = "Sheet of Looks"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import looks

        shown = context.scene.headturn
        looks.sheet(shown, range(shown.look_seed, shown.look_seed + SHEET), SHEET_COLUMNS)
        return {"FINISHED"}


class OpenLooks(bpy.types.Operator):
    """Open the sheet of looks in a window"""

    bl_idname = "headturn.open_looks"
    bl_label = "Open"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return pictures.LOOKS in bpy.data.images

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.open_window("IMAGE_EDITOR", "image", bpy.data.images[pictures.LOOKS])
        return {"FINISHED"}


_CLASSES = (RollTheDice, ShowLook, LookSheet, OpenLooks)


def register() -> None:
    """Add the buttons."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

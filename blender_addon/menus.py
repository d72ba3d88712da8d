# SPDX-License-Identifier: GPL-3.0-or-later
"""Headturn in Blender's own menus, which F3 looks through: everything that a button does."""

from __future__ import annotations

import bpy

from . import presets, registration
from .operators import LoadHeads


class Headturn(bpy.types.Menu):
    """Everything that a button does."""

    bl_idname = "HEADTURN_MT_all"
    bl_label = "Headturn"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        for operator in registration.operators():
            text = getattr(operator, "in_menu", operator.bl_label)
            layout.operator(operator.bl_idname, text=text, translate=False)
        for menu in (presets.PosePresets, presets.LookPresets):
            layout.menu(menu.bl_idname)


def _in_add(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.operator(LoadHeads.bl_idname, text="Head (Headturn)", icon="USER", translate=False)


def _in_render(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu(Headturn.bl_idname)


_register, _unregister = registration.registering(Headturn)


def register() -> None:
    """Add them: Load Heads to Add, everything to Render."""
    _register()
    bpy.types.VIEW3D_MT_add.append(_in_add)
    bpy.types.TOPBAR_MT_render.append(_in_render)


def unregister() -> None:
    """Take them away."""
    bpy.types.VIEW3D_MT_add.remove(_in_add)
    bpy.types.TOPBAR_MT_render.remove(_in_render)
    _unregister()

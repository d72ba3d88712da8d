# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses and looks under names of the user's, by Blender's own presets: files in the user's folder."""

from __future__ import annotations

from typing import Any

import bpy
from bl_operators.presets import AddPresetBase

from .core.fields import fields
from .properties import ANGLES
from .registration import registering


def _values(*names: str) -> list[str]:
    return [f"bpy.context.scene.headturn.{name}" for name in names]


def _looks() -> list[str]:
    of_render = (field for field in fields() if field.setting.section == "render")
    return _values(*(name for field in of_render for name in field.properties()), "draws")


class PosePresets(bpy.types.Menu):
    """Poses that somebody kept."""

    bl_idname = "HEADTURN_MT_pose_presets"
    bl_label = "Pose Presets"
    preset_subdir = "headturn/poses"
    preset_operator = "script.execute_preset"
    draw = bpy.types.Menu.draw_preset


class LookPresets(bpy.types.Menu):
    """Cameras and lights that somebody kept."""

    bl_idname = "HEADTURN_MT_look_presets"
    bl_label = "Look Presets"
    preset_subdir = "headturn/looks"
    preset_operator = "script.execute_preset"
    draw = bpy.types.Menu.draw_preset


class AddPosePreset(AddPresetBase, bpy.types.Operator):  # type: ignore[misc]
    """Keep this pose under a name, or forget it"""

    bl_idname = "headturn.pose_preset"
    bl_label = "Keep Pose"
    preset_menu = PosePresets.bl_idname
    preset_subdir = PosePresets.preset_subdir
    preset_values = _values(*ANGLES)


class AddLookPreset(AddPresetBase, bpy.types.Operator):  # type: ignore[misc]
    """Keep camera and light under a name, or forget them"""

    bl_idname = "headturn.look_preset"
    bl_label = "Keep Look"
    preset_menu = LookPresets.bl_idname
    preset_subdir = LookPresets.preset_subdir
    preset_values = _looks()


def draw(layout: bpy.types.UILayout, menu: Any, keep: Any) -> None:
    """A row with a menu of presets, one to add and one to remove."""
    row = layout.row(align=True)
    row.menu(menu.bl_idname, text=menu.bl_label, translate=False)
    row.operator(keep.bl_idname, text="", icon="ADD")
    row.operator(keep.bl_idname, text="", icon="REMOVE").remove_active = True


register, unregister = registering(PosePresets, LookPresets, AddPosePreset, AddLookPreset)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab "Headturn" in the sidebar of the 3D view."""

from __future__ import annotations

from typing import ClassVar

import bpy

from . import building, pictures
from .core import panel
from .core.labels import one_line
from .core.looks import Look
from .rows import draw_rows
from .session import Shown, conversation, state
from .settings import chosen_head, pose, to_config
from .wrapping import message

NARROW = 16
"""Characters that the picture beside a message takes."""


class _Tab:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Headturn"


class HeadsPanel(_Tab, bpy.types.Panel):
    """Which heads, and which of them is shown."""

    bl_idname = "HEADTURN_PT_heads"
    bl_label = "Heads"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        draw_rows(layout, shown, panel.rows(("heads",), to_config(shown), selection=False))
        layout.operator("headturn.load_heads", icon="FILE_REFRESH")
        if line := panel.going_on(conversation):
            message(layout, context, line)
        if state.error and state.host_error:
            layout.operator("preferences.addon_show", text="Open Preferences").module = __package__
        if state.heads:
            self._draw_heads(context)

    def _draw_heads(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        message(layout, context, panel.found(state))
        row = layout.row(align=True)
        row.template_icon_view(shown, "gallery", show_labels=True, scale=4, scale_popup=4)
        column = row.column(align=True)
        _stepper(column, shown, "subject", len(state.subjects()) > 1)
        _stepper(column, shown, "expression", len(state.expressions(shown.subject)) > 1)
        for place, line in enumerate(panel.in_view(state, chosen_head(shown))):
            if place:
                message(layout, context, line)
            else:
                message(column, context, line, margin=NARROW)
        for line in panel.left_out(state):
            message(layout, context, line)


class SelectionPanel(_Tab, bpy.types.Panel):
    """Which of the source's heads, and how its meshes lie."""

    bl_idname = "HEADTURN_PT_selection"
    bl_parent_id = "HEADTURN_PT_heads"
    bl_label = "Selection"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        layout.use_property_split, layout.use_property_decorate = True, False
        draw_rows(layout, shown, panel.rows(("heads",), to_config(shown), selection=True))


class PosePanel(_Tab, bpy.types.Panel):
    """The pose that is shown."""

    bl_idname = "HEADTURN_PT_pose"
    bl_label = "Pose"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        column = layout.column(align=True)
        column.enabled = shown.head is not None
        for name in ("yaw", "pitch", "roll"):
            column.prop(shown, name, slider=True)
        row = layout.row(align=True)
        row.enabled = shown.head is not None
        cell = row.row(align=True)
        cell.enabled = shown.poses_kind == "grid"
        cell.prop(shown, "snap", toggle=True)
        row.operator("headturn.reset_pose", icon="LOOP_BACK")
        row = layout.row(align=True)
        row.prop(shown, "viewport", expand=True)
        row.operator("headturn.look", text="", icon="VIEW_CAMERA")
        row = layout.row()
        row.prop(shown, "show_axes")
        row.prop(shown, "show_landmarks")
        if shown.show_landmarks and shown.head is not None and (line := panel.landmarks(state)):
            layout.label(text=line.text, icon=line.icon)


class PosesPanel(_Tab, bpy.types.Panel):
    """The pose plan of the dataset."""

    bl_idname = "HEADTURN_PT_poses"
    bl_label = "Dataset Poses"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        values = to_config(shown)
        draw_rows(layout, shown, panel.rows(("poses",), values))
        message(layout, context, panel.pose_count(values))
        row = layout.row()
        row.enabled = shown.head is not None
        row.prop(shown, "on_timeline", toggle=True, icon="TIME")
        layout.operator("headturn.preview_extremes", icon="IMAGE_DATA")
        icon = pictures.icon(pictures.SHEET)
        if icon:
            layout.template_icon(icon_value=icon, scale=9)
            layout.label(text=state.extremes)
            layout.operator("headturn.show_sheet", icon="WINDOW")


class LookPanel(_Tab, bpy.types.Panel):
    """Camera, light and render settings of the build."""

    bl_idname = "HEADTURN_PT_look"
    bl_label = "Camera and Light"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        shown = context.scene.headturn
        draw_rows(self.layout, shown, panel.rows(("render",), to_config(shown)))


class LooksPanel(_Tab, bpy.types.Panel):
    """Looks that are drawn, by their seeds."""

    bl_idname = "HEADTURN_PT_looks"
    bl_label = "Looks"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        layout.prop(shown, "draws")
        layout.operator("headturn.roll_dice", icon="SHADERFX")
        row = layout.row(align=True)
        row.prop(shown, "look_seed")
        row.operator("headturn.show_look", text="", icon="FILE_REFRESH")
        if state.look is not None and (line := panel.look(state, chosen_head(shown), pose(shown))):
            icon = pictures.icon(pictures.LOOK)
            if icon:
                layout.template_icon(icon_value=icon, scale=9)
            message(layout, context, line)
            if state.look.left_out:
                message(layout, context, panel.Line(f"left out: {state.look.left_out}", "INFO"))
            self._draw_values(layout.column(align=True), state.look)
        layout.operator("headturn.look_sheet", icon="IMAGE_DATA")
        icon = pictures.icon(pictures.LOOKS)
        if icon:
            layout.template_icon(icon_value=icon, scale=9)
            layout.operator("headturn.open_looks", icon="WINDOW")

    @staticmethod
    def _draw_values(column: bpy.types.UILayout, look: Look) -> None:
        column.scale_y = 0.75
        for name, value in look.values():
            split = column.split(factor=0.56)
            split.label(text=one_line(name))
            split.label(text=one_line(value))


class BuildPanel(_Tab, bpy.types.Panel):
    """The dataset, and the build."""

    bl_idname = "HEADTURN_PT_build"
    bl_label = "Build"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown, build = self.layout, context.scene.headturn, building.current
        layout.prop(shown, "out", text="")
        draw_rows(layout, shown, panel.rows(panel.other_sections(), to_config(shown)))
        layout.prop(shown, "workers")
        row = layout.row(align=True)
        row.operator("headturn.load_config", text="Load", icon="IMPORT")
        row.operator("headturn.save_config", text="Save", icon="EXPORT")
        row = layout.row(align=True)
        row.scale_y = 1.4
        if build.runs:
            row.operator("headturn.cancel", icon="CANCEL")
            layout.progress(factor=build.progress.share, text=f"{build.progress.share:.0%}")
        else:
            row.operator("headturn.build", icon="PLAY")
        if line := panel.outcome(build, state):
            message(layout, context, line)
        icon = pictures.icon(building.LAST_IMAGE)
        if icon:
            layout.template_icon(icon_value=icon, scale=6)
        if building.REPORT in bpy.data.texts:
            layout.operator("headturn.report", icon="TEXT")


def _stepper(layout: bpy.types.UILayout, shown: Shown, name: str, several: bool) -> None:
    row = layout.row(align=True)
    for by, icon in ((-1, "TRIA_LEFT"), (0, ""), (1, "TRIA_RIGHT")):
        if not by:
            row.prop(shown, name, text="")
            continue
        cell = row.row(align=True)
        cell.enabled = several
        button = cell.operator("headturn.step_head", text="", icon=icon)
        button.what, button.by = name.upper(), by


_CLASSES = (HeadsPanel, SelectionPanel, PosePanel, PosesPanel, LookPanel, LooksPanel, BuildPanel)


def register() -> None:
    """Add the tab."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take the tab away."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

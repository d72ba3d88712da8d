# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab "Headturn" in the sidebar of the 3D view."""

from __future__ import annotations

import textwrap
from typing import ClassVar

import bpy

from . import building, heads, operators, pictures, session

WIDTH_PER_CHARACTER = 7.2
"""Pixels at a UI scale of 1, for breaking lines: Blender's labels do not wrap."""


class _Tab:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Headturn"


class HeadsPanel(_Tab, bpy.types.Panel):
    """Which heads, and which of them is shown."""

    bl_idname = "HEADTURN_PT_heads"
    bl_label = "Heads"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown, state = self.layout, context.scene.headturn, session.state
        layout.row().prop(shown, "source", expand=True)
        column = layout.column(align=True)
        if shown.source == "FOLDER":
            column.prop(shown, "folder", text="")
        else:
            row = column.row(align=True)
            row.prop(shown, "count")
            row.prop(shown, "seed")
            column.prop(shown, "sampled_expressions")
        layout.operator("headturn.load_heads", icon="FILE_REFRESH")
        if state.error:
            message(layout, context, state.error, "ERROR")
        elif state.checking or state.busy:
            message(layout, context, state.busy or "looking for Headturn...", "SORTTIME")
        if not state.heads:
            return
        subjects = state.subjects()
        left_out = f", {len(state.skipped)} left out" if state.skipped else ""
        message(layout, context, f"{len(state.heads)} heads of {len(subjects)} subjects{left_out}", "INFO")
        row = layout.row(align=True)
        icon = pictures.icon(heads.thumbnail_key(shown.subject, shown.expression))
        if icon:
            row.template_icon(icon_value=icon, scale=4)
        column = row.column(align=True)
        _stepper(column, shown, "subject", "SUBJECT", len(subjects) > 1)
        _stepper(column, shown, "expression", "EXPRESSION", len(state.expressions(shown.subject)) > 1)
        if shown.head is not None:
            column.label(text=f"{state.vertices:,} vertices")
        for note in state.notes:
            message(layout, context, note, "DOT")


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
        row.prop(shown, "snap", toggle=True)
        row.operator("headturn.reset_pose", icon="LOOP_BACK")
        row = layout.row(align=True)
        row.prop(shown, "viewport", expand=True)
        row.operator("headturn.look", text="", icon="VIEW_CAMERA")
        row = layout.row()
        row.prop(shown, "show_axes")
        row.prop(shown, "show_landmarks")
        if shown.show_landmarks and shown.head is not None:
            found = session.state.landmarks
            if found is not None:
                text = "468 landmarks found" if found[1] is not None else "no face was found at this pose"
                layout.label(text=text, icon="CHECKMARK" if found[1] is not None else "ERROR")


class PosesPanel(_Tab, bpy.types.Panel):
    """The pose plan of the dataset."""

    bl_idname = "HEADTURN_PT_poses"
    bl_label = "Dataset Poses"

    def draw(self, context: bpy.types.Context) -> None:
        from .core.errors import HeadturnError
        from .core.grid import plan_poses
        from .settings import poses_table

        layout, shown = self.layout, context.scene.headturn
        layout.prop(shown, "plan", text="")
        layout.row().prop(shown, "frame", expand=True)
        column = layout.column(align=True)
        if shown.plan == "csv":
            column.prop(shown, "csv_path", text="")
        else:
            for name in ("yaw_range", "pitch_range", "roll_range"):
                column.row(align=True).prop(shown, name)
        if shown.plan in ("uniform", "sobol"):
            row = layout.row(align=True)
            row.prop(shown, "pose_count")
            row.prop(shown, "pose_seed")
        try:
            count = len(plan_poses(poses_table(shown)))
        except HeadturnError as error:
            message(layout, context, str(error), "ERROR")
            return
        layout.label(text=f"{count:,} poses a head", icon="INFO")
        row = layout.row()
        row.enabled = shown.head is not None
        row.prop(shown, "on_timeline", toggle=True, icon="TIME")
        layout.operator("headturn.preview_extremes", icon="IMAGE_DATA")
        icon = pictures.icon(operators.SHEET)
        if icon:
            layout.template_icon(icon_value=icon, scale=9)
            layout.label(text=session.state.extremes)
            layout.operator("headturn.show_sheet", icon="WINDOW")


class LookPanel(_Tab, bpy.types.Panel):
    """Camera, light and render settings of the build."""

    bl_idname = "HEADTURN_PT_look"
    bl_label = "Camera and Light"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        layout.row().prop(shown, "preset", expand=True)
        column = layout.column(align=True)
        column.prop(shown, "resolution")
        column.prop(shown, "lens_mm")
        column.prop(shown, "projection", text="")
        column.prop(shown, "frame_head")
        row = column.row()
        row.enabled = not shown.frame_head
        row.prop(shown, "distance_mm")
        column = layout.column(align=True)
        for name in ("light_yaw_deg", "light_pitch_deg", "ambient"):
            column.prop(shown, name)
        layout.prop(shown, "background")


class BuildPanel(_Tab, bpy.types.Panel):
    """The dataset, and the build."""

    bl_idname = "HEADTURN_PT_build"
    bl_label = "Build"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown, build = self.layout, context.scene.headturn, building.current
        layout.prop(shown, "out", text="")
        column = layout.column(align=True)
        row = column.row(align=True)
        row.prop(shown, "images", text="")
        row.prop(shown, "image_format", text="")
        column.prop(shown, "validation")
        column.prop(shown, "workers")
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
        if build.runs or build.exit_code is not None:
            good = build.runs or build.exit_code == 0
            message(layout, context, build.headline(), "INFO" if good else "ERROR")
            icon = pictures.icon(building.LAST_IMAGE)
            if icon:
                layout.template_icon(icon_value=icon, scale=6)
        if building.REPORT in bpy.data.texts:
            layout.operator("headturn.report", icon="TEXT")


def message(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str) -> None:
    """A label of as many lines as the sidebar's width needs; nothing is cut off."""
    scale = context.preferences.system.ui_scale
    characters = max(16, int(context.region.width / scale / WIDTH_PER_CHARACTER) - 6)
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, characters) or [""]):
        column.label(text=line, icon=icon if number == 0 else "BLANK1")


def _stepper(
    layout: bpy.types.UILayout, shown: bpy.types.PropertyGroup, name: str, what: str, several: bool
) -> None:
    row = layout.row(align=True)
    for by, icon in ((-1, "TRIA_LEFT"), (0, ""), (1, "TRIA_RIGHT")):
        if not by:
            row.prop(shown, name, text="")
            continue
        cell = row.row(align=True)
        cell.enabled = several
        button = cell.operator("headturn.step_head", text="", icon=icon)
        button.what, button.by = what, by


_CLASSES = (HeadsPanel, PosePanel, PosesPanel, LookPanel, BuildPanel)


def register() -> None:
    """Add the tab."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take the tab away."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

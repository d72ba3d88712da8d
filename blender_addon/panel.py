# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab "Headturn" in the sidebar of the 3D view."""

from __future__ import annotations

from typing import ClassVar

import bpy

from . import __package__ as package
from . import building, operators, pictures, session
from .wrapping import message

SKIPPED_SHOWN = 3


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
            if state.host_error:
                layout.operator("preferences.addon_show", text="Open Preferences").module = package
        elif busy := session.busy():
            message(layout, context, busy, "SORTTIME")
        if state.heads:
            self._draw_heads(context)

    def _draw_heads(self, context: bpy.types.Context) -> None:
        layout, shown, state = self.layout, context.scene.headturn, session.state
        subjects = state.subjects()
        message(layout, context, f"{len(state.heads)} heads of {len(subjects)} subjects", "INFO")
        row = layout.row(align=True)
        row.template_icon_view(shown, "gallery", show_labels=True, scale=4, scale_popup=4)
        column = row.column(align=True)
        _stepper(column, shown, "subject", "SUBJECT", len(subjects) > 1)
        _stepper(column, shown, "expression", "EXPRESSION", len(state.expressions(shown.subject)) > 1)
        if state.displayed == (shown.subject, shown.expression):
            column.label(text=f"{state.vertices:,} vertices")
            for note in state.notes:
                message(layout, context, note, "DOT")
        elif state.displayed is not None:
            message(column, context, f"in view: {' '.join(state.displayed)}", "NONE", margin=16)
        for reason in state.skipped[:SKIPPED_SHOWN]:
            message(layout, context, f"left out: {reason}", "ERROR")
        if len(state.skipped) > SKIPPED_SHOWN:
            message(layout, context, f"and {len(state.skipped) - SKIPPED_SHOWN} more left out", "BLANK1")


class SelectionPanel(_Tab, bpy.types.Panel):
    """Which of the source's heads, and how its meshes lie."""

    bl_idname = "HEADTURN_PT_selection"
    bl_parent_id = "HEADTURN_PT_heads"
    bl_label = "Selection"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        layout.use_property_split, layout.use_property_decorate = True, False
        column = layout.column(align=True)
        column.prop(shown, "only_subjects")
        column.prop(shown, "only_expressions")
        if shown.source == "FOLDER":
            column = layout.column(align=True)
            for name in ("units", "up", "forward"):
                column.prop(shown, name)


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
        cell.enabled = shown.plan == "grid"
        cell.prop(shown, "snap", toggle=True)
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
        from .core.grid import NotDrawn, plan_poses
        from .settings import poses_table

        layout, shown = self.layout, context.scene.headturn
        layout.prop(shown, "plan", text="")
        layout.row().prop(shown, "frame", expand=True)
        column = layout.column(align=True)
        if shown.plan == "csv":
            column.prop(shown, "csv_path", text="")
        else:
            for name in ("yaw_range", "pitch_range", "roll_range"):
                row = column.row(align=True)
                if shown.plan == "grid":
                    row.prop(shown, name)
                else:
                    row.prop(shown, name, index=0)
                    row.prop(shown, name, index=1, text="to")
        if shown.plan in ("uniform", "sobol"):
            row = layout.row(align=True)
            row.prop(shown, "pose_count")
            row.prop(shown, "pose_seed")
        try:
            count = len(plan_poses(poses_table(shown)))
        except NotDrawn:
            count = shown.pose_count
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
        elif build.refused and session.state.error:
            message(layout, context, session.state.error, "ERROR")
        if building.REPORT in bpy.data.texts:
            layout.operator("headturn.report", icon="TEXT")


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


_CLASSES = (HeadsPanel, SelectionPanel, PosePanel, PosesPanel, LookPanel, BuildPanel)


def register() -> None:
    """Add the tab."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take the tab away."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

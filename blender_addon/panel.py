# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of the tab, in the order of their use."""

from __future__ import annotations

from typing import Any

import bpy

from . import build_lines, building, keys, own, pictures, presets, session, setting_up, waiting
from .core import panel
from .core.found import Listing
from .core.labels import one_line
from .core.looks import Look
from .core.units import angle_of
from .properties import ANGLES
from .registration import registering
from .rows import draw_rows
from .session import Shown, state
from .settings import chosen_head, pose, to_config
from .tab import Closed, Tab
from .wrapping import label, message

NARROW = 16
"""Characters that the picture beside a message takes."""


class HeadsPanel(Tab, bpy.types.Panel):
    """Which heads, and which of them is shown."""

    bl_idname = "HEADTURN_PT_heads"
    bl_label = "Heads"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        draw_rows(layout, shown, panel.rows(("heads",), to_config(shown)))
        layout.operator("headturn.load_heads", icon="FILE_REFRESH")
        waiting.draw(layout, context)
        if session.host_is_missing() or state.host_error:
            setting_up.draw(layout, context)
            button = layout.operator("preferences.addon_show", text="Open Preferences", translate=False)
            button.module = __package__
        placed, listing = keys.placed(shown), keys.listing(shown)
        lines = panel.in_view(placed, chosen_head(shown), keys.source(to_config(shown)))
        if listing.heads:
            self._draw_heads(context, listing, lines)
        else:
            for line in lines:
                message(layout, context, line)
        if own.is_own(context.scene):
            layout.operator("headturn.leave", icon="LOOP_BACK")
        if own.is_own(context.scene) or own.scenes():
            layout.operator("headturn.remove", icon="TRASH")

    def _draw_heads(self, context: bpy.types.Context, listing: Listing, lines: list[panel.Line]) -> None:
        layout, shown = self.layout, context.scene.headturn
        message(layout, context, panel.found(listing))
        row = layout.row(align=True)
        row.template_icon_view(shown, "gallery", show_labels=True, scale=4, scale_popup=4)
        column = row.column(align=True)
        _stepper(column, shown, "subject", len(listing.subjects()) > 1)
        _stepper(column, shown, "expression", len(listing.expressions(shown.subject)) > 1)
        for place, line in enumerate(lines):
            if place:
                message(layout, context, line)
            else:
                message(column, context, line, margin=NARROW)
        for line in panel.left_out(listing):
            message(layout, context, line)


class SelectionPanel(Closed, bpy.types.Panel):
    """Which of the source's heads, how its meshes lie, and what may be done with them."""

    bl_idname = "HEADTURN_PT_selection"
    bl_parent_id = HeadsPanel.bl_idname
    bl_label = panel.SELECTION

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        layout.use_property_split, layout.use_property_decorate = True, False
        draw_rows(layout, shown, panel.rows(("heads",), to_config(shown), panel.SELECTION))


class PosePanel(Tab, bpy.types.Panel):
    """The pose that is shown."""

    bl_idname = "HEADTURN_PT_pose"
    bl_label = "Pose"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        column = layout.column(align=True)
        column.enabled = own.head(shown) is not None
        for name in ANGLES:
            column.prop(shown, angle_of(name), slider=True)
        row = layout.row(align=True)
        row.enabled = own.head(shown) is not None
        cell = row.row(align=True)
        cell.enabled = shown.poses_kind == "grid"
        cell.prop(shown, "snap", toggle=True)
        row.operator("headturn.reset_pose", icon="LOOP_BACK")
        if line := panel.snap(to_config(shown)):
            message(layout, context, line)
        presets.draw(layout, presets.PosePresets, presets.AddPosePreset)


class ViewPanel(Tab, bpy.types.Panel):
    """How the head at this pose is shown."""

    bl_idname = "HEADTURN_PT_view"
    bl_parent_id = PosePanel.bl_idname
    bl_label = "View"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        row = layout.row(align=True)
        row.prop(shown, "viewport", expand=True)
        row.operator("headturn.look", text="", icon="VIEW_CAMERA")
        row = layout.row()
        row.prop(shown, "show_rings")
        row.prop(shown, "show_axes")
        layout.prop(shown, "show_landmarks")
        if (
            shown.show_landmarks
            and own.head(shown) is not None
            and (line := panel.landmarks(keys.landmarks(shown)))
        ):
            message(layout, context, line)


class PosesPanel(Tab, bpy.types.Panel):
    """The pose plan of the dataset."""

    bl_idname = "HEADTURN_PT_poses"
    bl_label = "Dataset Poses"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        values = to_config(shown)
        draw_rows(layout, shown, panel.rows(("poses",), values))
        message(layout, context, panel.pose_count(values))
        row = layout.row()
        row.enabled = own.head(shown) is not None
        row.prop(shown, "on_timeline", toggle=True, icon="TIME")
        layout.operator("headturn.preview_extremes", icon="IMAGE_DATA")
        icon = pictures.icon(pictures.SHEET)
        if icon and (found := keys.extremes(shown)):
            layout.template_icon(icon_value=icon, scale=9)
            label(layout, found)
            layout.operator("headturn.show_sheet", icon="WINDOW")


class LookPanel(Closed, bpy.types.Panel):
    """Camera, light and render settings of the build."""

    bl_idname = "HEADTURN_PT_look"
    bl_label = "Camera and Light"

    def draw(self, context: bpy.types.Context) -> None:
        shown = context.scene.headturn
        presets.draw(self.layout, presets.LookPresets, presets.AddLookPreset)
        draw_rows(self.layout, shown, panel.rows(("render",), to_config(shown)))


class _BelowLook(Closed):
    bl_parent_id = LookPanel.bl_idname

    def draw(self: Any, context: bpy.types.Context) -> None:
        shown = context.scene.headturn
        draw_rows(self.layout, shown, panel.rows(("render",), to_config(shown), self.bl_label))


class LampsPanel(_BelowLook, bpy.types.Panel):
    """Lamps beside the key light, and what skin does with light."""

    bl_idname = "HEADTURN_PT_lamps"
    bl_label = panel.LAMPS


class WornPanel(_BelowLook, bpy.types.Panel):
    """What heads wear, and what is before them."""

    bl_idname = "HEADTURN_PT_worn"
    bl_label = panel.WORN


class SensorPanel(_BelowLook, bpy.types.Panel):
    """What a camera does to the light."""

    bl_idname = "HEADTURN_PT_sensor"
    bl_label = panel.SENSOR


class LooksPanel(Tab, bpy.types.Panel):
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
        if (look := keys.look(shown)) is not None:
            icon = pictures.icon(pictures.LOOK)
            if icon:
                layout.template_icon(icon_value=icon, scale=9)
            message(layout, context, panel.look(look, pose(shown)))
            if look.left_out:
                message(layout, context, panel.Line(f"left out: {look.left_out}", "INFO"))
            self._draw_values(layout.column(align=True), look)
        layout.operator("headturn.look_sheet", icon="IMAGE_DATA")
        icon = pictures.icon(pictures.LOOKS)
        if icon and keys.has_sheet(shown):
            layout.template_icon(icon_value=icon, scale=9)
            layout.operator("headturn.open_looks", icon="WINDOW")

    @staticmethod
    def _draw_values(column: bpy.types.UILayout, look: Look) -> None:
        column.scale_y = 0.75
        for name, value in look.values():
            split = column.split(factor=0.56)
            label(split, one_line(name))
            label(split, one_line(value))


class BuildPanel(Tab, bpy.types.Panel):
    """The dataset, and the build."""

    bl_idname = "HEADTURN_PT_build"
    bl_label = "Build"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown, build = self.layout, context.scene.headturn, building.current
        layout.prop(shown, "out", text="")
        row = layout.row(align=True)
        row.scale_y = 1.4
        if build.runs:
            row.operator("headturn.cancel", icon="CANCEL")
        else:
            row.operator("headturn.build", icon="PLAY")
        build_lines.draw_before(layout, context)
        build_lines.draw_now(layout, context)
        icon = pictures.icon(building.LAST_IMAGE)
        if icon:
            layout.template_icon(icon_value=icon, scale=6)
        build_lines.draw_after(layout)


class OutputPanel(Closed, bpy.types.Panel):
    """What is written, how landmarks are found, and all of the settings as a file."""

    bl_idname = "HEADTURN_PT_output"
    bl_parent_id = BuildPanel.bl_idname
    bl_label = "Output and Detection"

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, context.scene.headturn
        draw_rows(layout, shown, panel.rows(panel.other_sections(), to_config(shown)))
        layout.prop(shown, "workers")
        row = layout.row(align=True)
        row.operator("headturn.load_config", text="Load", icon="IMPORT", translate=False)
        row.operator("headturn.save_config", text="Save", icon="EXPORT", translate=False)


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


register, unregister = registering(
    *(HeadsPanel, SelectionPanel, PosePanel, ViewPanel, PosesPanel),
    *(LookPanel, LampsPanel, WornPanel, SensorPanel, LooksPanel, BuildPanel, OutputPanel),
)

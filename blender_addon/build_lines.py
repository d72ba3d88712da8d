# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of the panel before a build, and buttons after it."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import building, keys, own, settings, windows
from .core import panel
from .core.panel import Line
from .registration import registering
from .wrapping import message

SHEET = "Headturn contact sheet"


class OpenFolder(bpy.types.Operator):
    """Open the folder of the dataset that was built last"""

    bl_idname = "headturn.open_folder"
    bl_label = "Open Folder"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        out = building.current.out
        return out is not None and out.is_dir()

    def execute(self, context: bpy.types.Context) -> set[str]:
        bpy.ops.wm.path_open(filepath=str(building.current.out))
        return {"FINISHED"}


class ContactSheet(bpy.types.Operator):
    """Show the contact sheet of the dataset that was built last in a window"""

    bl_idname = "headturn.contact_sheet"
    bl_label = "Contact Sheet"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _sheet() is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.keep_image(SHEET, str(_sheet()))
        windows.open_window("IMAGE_EDITOR", "image", own.kept(bpy.data.images, SHEET))
        return {"FINISHED"}


def draw_before(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """How much it will be."""
    from .core import forecast  # numpy comes in with the first tab that is opened

    shown = context.scene.headturn
    values = settings.to_config(shown)
    much = forecast.amount(values, keys.listing(shown))
    if much is None or building.current.runs:
        return
    message(layout, context, Line(much.line(), "INFO"))
    like, pixels = forecast.likeness(values, shown.workers)
    rate = building.last_rate() or forecast.guess(values, shown.workers)
    if said := forecast.forecast(much, like, pixels, rate):
        message(layout, context, Line(said, "BLANK1"))


def draw_now(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """How far it is, or how it ended."""
    build = building.current
    if build.runs:
        layout.progress(factor=build.progress.share, text=f"{build.progress.share:.0%}")
    if line := panel.outcome(build):
        message(layout, context, line)


def draw_after(layout: bpy.types.UILayout) -> None:
    """Where to look."""
    build = building.current
    if not build.report:
        return
    row = layout.row(align=True)
    if build.progress.result is not None:
        row.operator("headturn.open_folder", text="Folder", icon="FILE_FOLDER")
        row.operator("headturn.contact_sheet", text="Sheet", icon="IMAGE_DATA", translate=False)
    text = "Report" if build.progress.result else "Open Report"
    row.operator("headturn.report", text=text, icon="TEXT", translate=False)


def _sheet() -> Path | None:
    result = building.current.progress.result or {}
    pictures = [Path(path) for path in result.get("pictures", ()) if Path(path).name == "contact_sheet.png"]
    return next((path for path in pictures if path.is_file()), None)


register, unregister = registering(OpenFolder, ContactSheet)

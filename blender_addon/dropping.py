# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads that are dropped into the 3D view.

Blender hands over files with an ending, and no folders: a file stands for the folder that it lies in, too.
It asks which, as wherever several could read a file. Offered where our tab is open or our scene is shown, so
that nobody who drops a mesh into a scene of his own is asked more than before.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import bpy
from bpy.props import CollectionProperty, StringProperty

from . import own
from .core.texts import FOLDER, MESHES
from .operators import nothing_is_due
from .registration import registering
from .tab import CATEGORY


class _Drop:
    """The file, or files, that were dropped."""

    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO", "INTERNAL"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return nothing_is_due(cls)

    def load(self, context: bpy.types.Context, source: Path) -> set[str]:
        """Have these heads."""
        from . import heads

        shown = context.scene.headturn
        shown.heads_source, shown.heads_source_folder = FOLDER, str(source)
        heads.list_heads(context.scene)
        return {"FINISHED"}


class DropHead(_Drop, bpy.types.Operator):
    """Show this head"""

    bl_idname = "headturn.drop_head"
    bl_label = "Head for Headturn"

    def execute(self, context: bpy.types.Context) -> set[str]:
        if len(self.files) > 1:
            self.report({"WARNING"}, "Several heads are a folder: choose Folder of Heads for Headturn")
            return {"CANCELLED"}
        return self.load(context, Path(self.filepath))


class DropFolder(_Drop, bpy.types.Operator):
    """Show the heads of the folder in which these files are"""

    bl_idname = "headturn.drop_folder"
    bl_label = "Folder of Heads for Headturn"

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.load(context, Path(self.filepath).parent)


class _Handler:
    bl_file_extensions = ";".join(MESHES)

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        area = context.area
        if area is None or area.type != "VIEW_3D":
            return False
        sides = (region for region in area.regions if region.type == "UI" and region.width > 1)
        return own.is_own(context.scene) or any(side.active_panel_category == CATEGORY for side in sides)


class HeadHandler(_Handler, bpy.types.FileHandler):
    """A mesh that is dropped."""

    bl_idname = "HEADTURN_FH_head"
    bl_label = DropHead.bl_label
    bl_import_operator = DropHead.bl_idname


class FolderHandler(_Handler, bpy.types.FileHandler):
    """The folder of a mesh that is dropped."""

    bl_idname = "HEADTURN_FH_folder"
    bl_label = DropFolder.bl_label
    bl_import_operator = DropFolder.bl_idname


register, unregister = registering(DropHead, DropFolder, HeadHandler, FolderHandler)

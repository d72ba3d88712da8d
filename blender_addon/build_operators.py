# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the build: start and end it, open its report, read and write its configuration."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from generator.errors import HeadturnError

from . import building, session, settings, windows
from .core.labels import one_line
from .operators import source_is_named
from .registration import registering

STAYS = "What is finished stays, and building into the same folder goes on from there"

LEFT_OUT = 3
"""Exit code of a build that finished with something left out."""


class BuildDataset(bpy.types.Operator):
    """Start the host on these settings: the same dataset as headturn build on the command line"""

    bl_idname = "headturn.build"
    bl_label = "Build"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if building.current.runs:
            cls.poll_message_set("A build is running")
            return False
        if not context.scene.headturn.out:
            cls.poll_message_set("Choose the folder of the dataset first")
            return False
        return source_is_named(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """From a button or a menu: start it, and let the user go on."""
        try:
            building.begin(context.scene.headturn)
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        windows.redraw()
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """From a script: build to the end. Python gets a RuntimeError where there is no dataset then."""
        build = building.current
        try:
            building.run(context.scene.headturn)
        except HeadturnError as error:
            build.refuse(str(error))
        if build.exit_code not in (0, LEFT_OUT):
            self.report({"ERROR"}, one_line(build.refused or build.headline()))
            return {"CANCELLED"}
        self.report({"INFO" if build.exit_code == 0 else "WARNING"}, one_line(build.headline()))
        return {"FINISHED"}


class CancelBuild(bpy.types.Operator):
    """End the build in order; what is finished stays, and building again continues"""

    bl_idname = "headturn.cancel"
    bl_label = "Cancel"
    in_menu = "Cancel Build"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return building.current.runs

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        text = {"title": "Stop the build?", "confirm_text": "Stop", "message": STAYS}
        return context.window_manager.invoke_confirm(self, event, **text)

    def execute(self, context: bpy.types.Context) -> set[str]:
        building.current.cancel()
        windows.redraw()
        return {"FINISHED"}


class ShowText(bpy.types.Operator):
    """Open what the last build said in a window"""

    bl_idname = "headturn.report"
    bl_label = "Open Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(building.current.report)

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.open_window("TEXT_EDITOR", "text", building.report())
        return {"FINISHED"}


class LoadConfig(bpy.types.Operator, ImportHelper):
    """Take the settings of a configuration file of the command line"""

    bl_idname = "headturn.load_config"
    bl_label = "Load Configuration"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}
    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})  # type: ignore[valid-type]

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import studio, timeline  # numpy comes in with the first click

        try:
            settings.load(context.scene.headturn, Path(self.filepath))
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        session.state.error = ""
        studio.look_changed(context.scene)
        timeline.plan_changed(context.scene)
        return {"FINISHED"}


class SaveConfig(bpy.types.Operator, ExportHelper):
    """Write these settings as the configuration that headturn build takes"""

    bl_idname = "headturn.save_config"
    bl_label = "Save Configuration"
    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})  # type: ignore[valid-type]

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            settings.save(context.scene.headturn, Path(self.filepath))
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        self.report({"INFO"}, one_line(f"headturn build {self.filepath}"))
        return {"FINISHED"}


register, _unregister = registering(BuildDataset, CancelBuild, ShowText, LoadConfig, SaveConfig)


def unregister() -> None:
    """End what they started, and take them away."""
    building.close()
    _unregister()

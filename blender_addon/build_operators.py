# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the build: start and end it, open its report, read and write its configuration."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from generator.errors import HeadturnError

from . import building, session, settings, windows
from .core.labels import one_line
from .operators import source_is_named

LEFT_OUT = 3
"""Exit code of a build that finished with something left out."""


class BuildDataset(bpy.types.Operator):
    """Start the host on these settings: the same dataset as headturn build on the command line"""

    bl_idname = "headturn.build"
    bl_label = "Build"

    _timer: Any = None

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
        session.state.error = ""
        building.forget()
        name = context.scene.name

        def start() -> None:
            try:
                building.start(bpy.data.scenes[name])
            except HeadturnError as error:
                session.state.error = str(error)

        session.with_host(start)
        self._timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Once every 0.1 s, and on every event: Esc ends the build."""
        build = building.current
        if event.type == "ESC" and event.value == "PRESS" and build.runs:
            build.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if building.poll():
            windows.redraw()
        if build.runs or session.state.checking:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        if build.exit_code is None:
            build.refused = True
            self.report({"ERROR"}, one_line(session.state.error))
        elif build.exit_code != 0 and not build.cancelled:
            self.report({"WARNING" if build.exit_code == LEFT_OUT else "ERROR"}, one_line(build.headline()))
        windows.redraw()
        return {"FINISHED"}


class CancelBuild(bpy.types.Operator):
    """End the build in order; what is finished stays, and building again continues"""

    bl_idname = "headturn.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return building.current.runs

    def execute(self, context: bpy.types.Context) -> set[str]:
        building.current.cancel()
        return {"FINISHED"}


class ShowText(bpy.types.Operator):
    """Open what the last build said in a window"""

    bl_idname = "headturn.report"
    bl_label = "Open Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return building.REPORT in bpy.data.texts

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.open_window("TEXT_EDITOR", "text", bpy.data.texts[building.REPORT])
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
        session.state.forget_heads()
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


_CLASSES = (BuildDataset, CancelBuild, ShowText, LoadConfig, SaveConfig)


def register() -> None:
    """Add the buttons."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """End what they started, and take them away."""
    building.current.close()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

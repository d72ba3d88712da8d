# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from . import building, heads, pictures, session

SHEET = "sheet"


def _needs_head(cls: Any, context: bpy.types.Context) -> bool:
    if context.scene.headturn.head is None:
        cls.poll_message_set("Load heads first")
        return False
    return True


def _error_types() -> type[Exception]:
    from .core.errors import HeadturnError

    return HeadturnError


class CheckHost(bpy.types.Operator):
    """Find the Python with Headturn and ask it for its versions"""

    bl_idname = "headturn.check_host"
    bl_label = "Check"

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.forget_host()
        session.with_host(session.redraw)
        return {"FINISHED"}


class LoadHeads(bpy.types.Operator):
    """Look what the source holds and show its first head, in a scene of its own"""

    bl_idname = "headturn.load_heads"
    bl_label = "Load Heads"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        shown = context.scene.headturn
        if shown.source == "FOLDER" and not shown.folder:
            cls.poll_message_set("Choose the folder of the heads first")
            return False
        if session.is_busy():
            cls.poll_message_set("Wait for what is going on")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        heads.list_heads(context.scene)
        return {"FINISHED"}


class StepHead(bpy.types.Operator):
    """Show the next or previous one"""

    bl_idname = "headturn.step_head"
    bl_label = "Step"

    what: bpy.props.EnumProperty(items=(("SUBJECT", "", ""), ("EXPRESSION", "", "")))  # type: ignore[valid-type]
    by: bpy.props.IntProperty(default=1)  # type: ignore[valid-type]

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """The tooltip."""
        return f"{'Next' if properties.by > 0 else 'Previous'} {properties.what.lower()}"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not session.state.heads:
            cls.poll_message_set("Load heads first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        heads.step(context.scene.headturn, self.what, self.by)
        return {"FINISHED"}


class ResetPose(bpy.types.Operator):
    """Back to pose zero: yaw, pitch and roll 0"""

    bl_idname = "headturn.reset_pose"
    bl_label = "Pose Zero"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import studio

        studio.set_pose(context.scene.headturn, (0.0, 0.0, 0.0))
        return {"FINISHED"}


class LookThroughCamera(bpy.types.Operator):
    """Look through the camera of the build, without the user's own view settings in the way"""

    bl_idname = "headturn.look"
    bl_label = "Look Through Camera"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _needs_head(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import studio

        studio.show_views(context.scene.headturn)
        return {"FINISHED"}


class PreviewExtremes(bpy.types.Operator):
    """Render the outermost poses in the background, with the landmarks found"""

    bl_idname = "headturn.preview_extremes"
    bl_label = "Preview Extremes"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if session.is_busy():
            cls.poll_message_set("Wait for what is going on")
            return False
        return _needs_head(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import landmarks
        from .core.grid import extremes
        from .settings import poses_table

        def take(answer: dict[str, Any]) -> None:
            pictures.keep(SHEET, Path(answer["sheet"]))
            image = bpy.data.images.get("Headturn extremes")
            if image is None:
                image = bpy.data.images.load(answer["sheet"])
                image.name = "Headturn extremes"
            image.reload()
            found = sum(points is not None for points in answer["landmarks"])
            session.state.extremes = f"A face was found in {found} of {len(answer['landmarks'])}"

        shown = context.scene.headturn
        try:
            poses = extremes(poses_table(shown))
        except _error_types() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        landmarks.request_pictures(shown, poses, "rendering the extremes...", take, sheet=3)
        return {"FINISHED"}


class BuildDataset(bpy.types.Operator):
    """Start the host on these settings: the same dataset as headturn build on the command line"""

    bl_idname = "headturn.build"
    bl_label = "Build"

    _timer: Any = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        shown = context.scene.headturn
        if building.current.runs:
            cls.poll_message_set("A build is running")
            return False
        if not shown.out:
            cls.poll_message_set("Choose the folder of the dataset first")
            return False
        if shown.source == "FOLDER" and not shown.folder:
            cls.poll_message_set("Choose the folder of the heads first")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        session.state.error = ""
        building.current.forget()
        name = context.scene.name

        def start() -> None:
            try:
                building.current.start(bpy.data.scenes[name])
            except _error_types() as error:
                session.state.error = str(error)

        session.with_host(start)
        self._timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Once every 0.1 s, and on every event: Esc ends the build."""
        if event.type == "ESC" and event.value == "PRESS" and building.current.runs:
            building.current.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if building.current.poll():
            session.redraw()
        if building.current.runs or session.state.checking:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        if building.current.exit_code is None:
            building.current.refused = True
            self.report({"ERROR"}, session.state.error)
        elif building.current.exit_code != 0 and not building.current.cancelled:
            self.report(
                {"ERROR" if building.current.exit_code != 3 else "WARNING"}, building.current.headline()
            )
        session.redraw()
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
        _open(context, "TEXT_EDITOR", "text", bpy.data.texts[building.REPORT])
        return {"FINISHED"}


class ShowSheet(bpy.types.Operator):
    """Open the extremes in a window"""

    bl_idname = "headturn.show_sheet"
    bl_label = "Open"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return "Headturn extremes" in bpy.data.images

    def execute(self, context: bpy.types.Context) -> set[str]:
        _open(context, "IMAGE_EDITOR", "image", bpy.data.images["Headturn extremes"])
        return {"FINISHED"}


class LoadConfig(bpy.types.Operator, ImportHelper):
    """Take the settings of a configuration file of the command line"""

    bl_idname = "headturn.load_config"
    bl_label = "Load Configuration"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}
    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})  # type: ignore[valid-type]

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import settings, studio, timeline

        try:
            settings.load(context.scene.headturn, Path(self.filepath))
        except _error_types() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        session.state.heads = []
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
        from . import settings

        try:
            settings.save(context.scene.headturn, Path(self.filepath))
        except _error_types() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"headturn build {self.filepath}")
        return {"FINISHED"}


def _open(context: bpy.types.Context, kind: str, slot: str, what: Any) -> None:
    bpy.ops.wm.window_new()
    area = context.window_manager.windows[-1].screen.areas[0]
    area.type = kind
    setattr(area.spaces.active, slot, what)


_CLASSES = (
    CheckHost,
    LoadHeads,
    StepHead,
    ResetPose,
    LookThroughCamera,
    PreviewExtremes,
    BuildDataset,
    CancelBuild,
    ShowText,
    ShowSheet,
    LoadConfig,
    SaveConfig,
)


def register() -> None:
    """Add the buttons."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """End what they started, and take them away."""
    building.current.close()
    pictures.clear()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)

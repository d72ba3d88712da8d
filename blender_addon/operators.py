# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that show something: heads, poses, pictures.

What acts is imported with the first click: it takes numpy and the generator's scene code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import bpy

from generator.errors import HeadturnError

from . import keys, own, pictures, session, settings, windows
from .core.labels import one_line
from .core.texts import asks_for_folder
from .registration import registering

EXTREMES = "Headturn extremes"
SHEET_COLUMNS = 3


def source_is_named(cls: Any, context: bpy.types.Context) -> bool:
    """For a poll: is it known where the heads are?"""
    shown = context.scene.headturn
    if asks_for_folder(shown.heads_source) and not shown.heads_source_folder:
        cls.poll_message_set("Choose the folder of the heads first")
        return False
    return True


def nothing_is_due(cls: Any) -> bool:
    """For a poll: does the host have time?"""
    if session.conversation.is_busy:
        cls.poll_message_set("Wait for what is going on")
        return False
    return True


def there_is_a_head(cls: Any, context: bpy.types.Context) -> bool:
    """For a poll: is a head in view?"""
    if own.head(context.scene.headturn) is None:
        cls.poll_message_set("Load heads first")
        return False
    return True


class CheckHost(bpy.types.Operator):
    """Find the Python with Headturn and ask it for its versions"""

    bl_idname = "headturn.check_host"
    bl_label = "Check"
    in_menu = "Check the Python with Headturn"

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.forget_host()
        session.with_host(windows.redraw)
        return {"FINISHED"}


class LoadHeads(bpy.types.Operator):
    """Look what the source holds and show its first head, in a scene of its own"""

    bl_idname = "headturn.load_heads"
    bl_label = "Load Heads"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return source_is_named(cls, context) and nothing_is_due(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import heads

        heads.list_heads(context.scene)
        return {"FINISHED"}


class StepHead(bpy.types.Operator):
    """Show the next or previous one"""

    bl_idname = "headturn.step_head"
    bl_label = "Step"
    bl_options: ClassVar[set[str]] = {"REGISTER", "INTERNAL"}

    what: bpy.props.EnumProperty(items=(("SUBJECT", "", ""), ("EXPRESSION", "", "")))  # type: ignore[valid-type]
    by: bpy.props.IntProperty(default=1)  # type: ignore[valid-type]

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """The tooltip."""
        return f"{'Next' if properties.by > 0 else 'Previous'} {properties.what.lower()}"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not keys.listing(context.scene.headturn).heads:
            cls.poll_message_set("Load heads first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import heads

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
        return there_is_a_head(cls, context)

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
        return nothing_is_due(cls) and there_is_a_head(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        from . import landmarks
        from .core import found
        from .core.grid import extremes

        shown = context.scene.headturn
        key = keys.of_plan(shown)

        def take(answer: dict[str, Any]) -> None:
            pictures.keep(pictures.SHEET, Path(answer["sheet"]))
            windows.keep_image(EXTREMES, answer["sheet"])
            session.state.extremes.take(key, found.extremes(answer["landmarks"]))

        try:
            poses = extremes(settings.poses(shown))
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        config = settings.to_config(shown)
        landmarks.request_pictures(
            shown, config, poses, "rendering the extremes...", take, sheet=SHEET_COLUMNS
        )
        return {"FINISHED"}


class ShowSheet(bpy.types.Operator):
    """Open the extremes in a window"""

    bl_idname = "headturn.show_sheet"
    bl_label = "Open"
    in_menu = "Open Extremes"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return own.kept(bpy.data.images, EXTREMES) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows.open_window("IMAGE_EDITOR", "image", own.kept(bpy.data.images, EXTREMES))
        return {"FINISHED"}


register, unregister = registering(
    CheckHost, LoadHeads, StepHead, ResetPose, LookThroughCamera, PreviewExtremes, ShowSheet
)

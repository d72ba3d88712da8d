# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows when Blender shows another frame or scene, undoes something, or opens a file."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import overlay, own, session, stages, views, windows

GONE = "the head in view is as it was saved; its files are here no longer: Load Heads makes them anew"
_OWNER = object()
"""Who listens to windows that show another scene."""


@bpy.app.handlers.persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    if scene.headturn.on_timeline and own.head(scene.headturn) is not None:
        from . import timeline

        timeline.show_frame(scene)


@bpy.app.handlers.persistent
def _on_change(scene: bpy.types.Scene, *_: object) -> None:
    """Keyframes and drivers set properties without their update functions."""
    if own.is_own(scene) and own.head(scene.headturn) is not None:
        from . import studio

        studio.follow_pose(scene.headturn)


@bpy.app.handlers.persistent
def _on_undo(*_: object) -> None:
    from . import landmarks

    stages.forget()
    for scene in own.scenes():
        landmarks.pose_changed(scene.headturn)


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    """What was asked for one file is of no use to another; a build goes on."""
    session.conversation.drop()
    session.state.error = ""


@bpy.app.handlers.persistent
def _on_load(*_: object) -> None:
    stages.forget()
    _listen()
    for scene in own.scenes():
        if own.head(scene.headturn) is not None and not Path(scene.headturn.package).is_file():
            session.state.error = GONE
    if any(own.head(scene.headturn) is not None for scene in own.scenes()):
        overlay.ensure()
        windows.redraw_views()


_HANDLERS = {
    # Before the frame is evaluated, so that the head turns with this frame and not with the next.
    "frame_change_pre": _on_frame,
    # After it, when animation has said what the pose is; Blender evaluates what is changed here once more.
    "frame_change_post": _on_change,
    "depsgraph_update_post": _on_change,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
    "load_pre": _before_load,
    "load_post": _on_load,
}


def register() -> None:
    """Follow them."""
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)
    # The file that is open may hold a head; while extensions are enabled it cannot be looked at.
    bpy.app.timers.register(_on_load, first_interval=0.0)


def unregister() -> None:
    """Follow them no longer."""
    if bpy.app.timers.is_registered(_on_load):
        bpy.app.timers.unregister(_on_load)
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
    bpy.msgbus.clear_by_owner(_OWNER)
    stages.forget()
    overlay.remove()


def _listen() -> None:
    """A window that somebody turns to a scene of his own gets its views back."""
    bpy.msgbus.clear_by_owner(_OWNER)
    bpy.msgbus.subscribe_rna(key=(bpy.types.Window, "scene"), owner=_OWNER, args=(), notify=views.give_back)

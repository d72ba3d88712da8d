# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows when Blender shows another frame, undoes something, or opens a file."""

from __future__ import annotations

import bpy

from . import overlay, stages, windows


@bpy.app.handlers.persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    if scene.headturn.on_timeline and scene.headturn.head is not None:
        from . import timeline

        timeline.show_frame(scene)


@bpy.app.handlers.persistent
def _on_undo(*_: object) -> None:
    stages.forget()


@bpy.app.handlers.persistent
def _on_load(*_: object) -> None:
    stages.forget()
    if any(scene.headturn.head for scene in bpy.data.scenes):
        overlay.ensure()
        windows.redraw_views()


_HANDLERS = {
    # Before the frame is evaluated, so that the head turns with this frame and not with the next.
    "frame_change_pre": _on_frame,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
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
    stages.forget()
    overlay.remove()

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan on the timeline: frame k shows pose k of the dataset."""

from __future__ import annotations

import bpy

from . import session


def plan_changed(scene: bpy.types.Scene) -> None:
    """Lay the plan on the timeline, or leave the timeline alone."""
    from .core.errors import HeadturnError
    from .core.grid import plan_poses
    from .settings import poses_table

    shown = scene.headturn
    if session.is_quiet() or not shown.on_timeline:
        return
    try:
        count = len(plan_poses(poses_table(shown)))
    except HeadturnError:
        return  # the panel says why
    scene.frame_start, scene.frame_end = 1, count
    if not 1 <= scene.frame_current <= count:
        scene.frame_set(1)
    show_frame(scene)
    _fit_timelines(scene)


def _fit_timelines(scene: bpy.types.Scene) -> None:
    """Show all frames of the plan at once."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if window.scene == scene and area.type == "DOPESHEET_EDITOR":
                region = next(r for r in area.regions if r.type == "WINDOW")
                with bpy.context.temp_override(window=window, area=area, region=region):
                    if bpy.ops.action.view_all.poll():
                        bpy.ops.action.view_all()


def show_frame(scene: bpy.types.Scene) -> None:
    """Turn the head to the pose of the current frame."""
    from . import studio
    from .core.errors import HeadturnError
    from .core.grid import plan_poses
    from .settings import poses_table

    try:
        plan = plan_poses(poses_table(scene.headturn))
    except HeadturnError:
        return  # the panel says why
    index = min(max(scene.frame_current - 1, 0), len(plan) - 1)
    studio.set_pose(scene.headturn, tuple(plan.angles_deg[index].tolist()))


@bpy.app.handlers.persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    if scene.headturn.on_timeline and scene.headturn.head is not None:
        show_frame(scene)


@bpy.app.handlers.persistent
def _on_load(*_: object) -> None:
    if any(scene.headturn.head for scene in bpy.data.scenes):
        from . import overlay

        overlay.ensure()


def register() -> None:
    """Follow the timeline."""
    # Before the frame is evaluated, so that the head turns with this frame and not with the next.
    bpy.app.handlers.frame_change_pre.append(_on_frame)
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Follow it no longer."""
    import sys

    bpy.app.handlers.frame_change_pre.remove(_on_frame)
    bpy.app.handlers.load_post.remove(_on_load)
    overlay = sys.modules.get(f"{__package__}.overlay")
    if overlay is not None:
        overlay.remove()

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan on the timeline: frame k shows pose k of the dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import session

if TYPE_CHECKING:
    from generator.plan.poses import PosePlan

    from .properties import HeadturnSettings

_drawing: list[dict[str, Any]] = []


def plan_changed(scene: bpy.types.Scene) -> None:
    """Lay the plan on the timeline, or leave the timeline alone."""
    shown = scene.headturn
    if session.is_quiet() or not shown.on_timeline:
        return
    _drawing.clear()
    plan = _plan(shown)
    if plan is None:
        return
    count = len(plan)
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

    plan = _plan(scene.headturn)
    if plan is None:
        return
    index = min(max(scene.frame_current - 1, 0), len(plan) - 1)
    studio.set_pose(scene.headturn, tuple(plan.angles_deg[index].tolist()))


def _plan(shown: HeadturnSettings) -> PosePlan | None:
    """The poses; None while the host draws them, or if they make no sense, which the panel says."""
    from .core.errors import HeadturnError
    from .core.grid import NotDrawn, plan_poses
    from .settings import poses_table

    table = poses_table(shown)
    try:
        return plan_poses(table)
    except NotDrawn:
        _have_drawn(shown, table)
    except HeadturnError:
        pass
    return None


def _have_drawn(shown: HeadturnSettings, table: dict[str, Any]) -> None:
    from .core.grid import remember
    from .heads import cache_folder

    if table in _drawing:  # asked for, or refused, which the panel says
        return
    _drawing[:] = [table]
    file, name = cache_folder() / "poses.npy", shown.id_data.name

    def take(answer: dict[str, Any]) -> None:
        remember(table, Path(file))
        if name in bpy.data.scenes:
            plan_changed(bpy.data.scenes[name])

    message = {"op": "plan", "poses": table, "file": str(file)}
    session.request(message, "drawing the poses...", take)


@bpy.app.handlers.persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    if scene.headturn.on_timeline and scene.headturn.head is not None:
        show_frame(scene)


@bpy.app.handlers.persistent
def _on_load(*_: object) -> None:
    if any(scene.headturn.head for scene in bpy.data.scenes):
        from . import overlay

        overlay.ensure()
        session.redraw_views()


def register() -> None:
    """Follow the timeline."""
    # Before the frame is evaluated, so that the head turns with this frame and not with the next.
    bpy.app.handlers.frame_change_pre.append(_on_frame)
    bpy.app.handlers.load_post.append(_on_load)
    # The file that is open may hold a head; while extensions are enabled it cannot be looked at.
    bpy.app.timers.register(_on_load, first_interval=0.0)


def unregister() -> None:
    """Follow it no longer."""
    import sys

    if bpy.app.timers.is_registered(_on_load):
        bpy.app.timers.unregister(_on_load)
    bpy.app.handlers.frame_change_pre.remove(_on_frame)
    bpy.app.handlers.load_post.remove(_on_load)
    overlay = sys.modules.get(f"{__package__}.overlay")
    if overlay is not None:
        overlay.remove()

# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan on the timeline: frame k shows pose k of the head in view."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from generator.errors import HeadturnError
from generator.plan.settings import Poses

from . import folders, keys, own, session, settings, studio
from .core.found import HeadName
from .core.grid import NotDrawn, has_own, plan_poses, remember
from .session import Shown

if TYPE_CHECKING:
    from generator.plan.poses import PosePlan

_asked: list[tuple[Poses, HeadName]] = []
_files = count()


def plan_changed(scene: bpy.types.Scene) -> None:
    """Lay the plan on the timeline, or leave the timeline as it was before."""
    shown = scene.headturn
    if not shown.on_timeline or own.head(shown) is None:
        _give_back(scene)
        return
    _asked.clear()
    plan = _plan(shown)
    if plan is None:
        return
    frames = len(plan)
    if not shown.is_property_set("frames"):
        shown.frames = scene.frame_start, scene.frame_end, scene.frame_current
    scene.frame_start, scene.frame_end = 1, frames
    if not 1 <= scene.frame_current <= frames:
        scene.frame_set(1)
    show_frame(scene)
    _fit_timelines(scene)


def _give_back(scene: bpy.types.Scene) -> None:
    shown = scene.headturn
    if shown.is_property_set("frames"):
        scene.frame_start, scene.frame_end, current = shown.frames
        shown.property_unset("frames")
        scene.frame_set(current)


def head_changed(scene: bpy.types.Scene) -> None:
    """Another head is in view: its own poses, if each has its own."""
    if has_own(settings.poses(scene.headturn)):
        plan_changed(scene)


def show_frame(scene: bpy.types.Scene) -> None:
    """Turn the head to the pose of the current frame."""
    plan = _plan(scene.headturn)
    if plan is None:
        return
    index = min(max(scene.frame_current - 1, 0), len(plan) - 1)
    studio.set_pose(scene.headturn, tuple(plan.angles_deg[index].tolist()))


def _fit_timelines(scene: bpy.types.Scene) -> None:
    """Show all frames of the plan at once."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if window.scene == scene and area.type == "DOPESHEET_EDITOR":
                region = next(r for r in area.regions if r.type == "WINDOW")
                with bpy.context.temp_override(window=window, area=area, region=region):
                    if bpy.ops.action.view_all.poll():
                        bpy.ops.action.view_all()


def _plan(shown: Shown) -> PosePlan | None:
    """The poses; None while the host draws them, or if they make no sense, which the panel says."""
    poses, head = settings.poses(shown), keys.viewed(shown)
    try:
        return plan_poses(poses, head)
    except NotDrawn:
        _have_drawn(shown, poses, head)
    except HeadturnError:
        pass
    return None


def _have_drawn(shown: Shown, poses: Poses, head: HeadName) -> None:
    if (poses, head) in _asked:  # asked for, or refused, which the panel says
        return
    _asked.append((poses, head))
    file, name = folders.scratch("poses") / f"{next(_files)}.npy", shown.id_data.name

    def take(answer: dict[str, Any]) -> None:
        remember(poses, head, Path(file))
        Path(file).unlink()
        if name in bpy.data.scenes:
            plan_changed(bpy.data.scenes[name])

    message = {
        "op": "plan",
        "config": settings.to_config(shown),
        "subject": head[0],
        "expression": head[1],
        "file": str(file),
    }
    session.request(message, "drawing the poses...", take)

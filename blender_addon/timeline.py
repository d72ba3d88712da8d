# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose plan on the timeline: frame k shows pose k of the head in view."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from generator.errors import HeadturnError
from generator.plan.settings import Poses

from . import session, settings, studio
from .core.grid import NotDrawn, has_own, plan_poses, remember
from .core.state import HeadName
from .session import Shown

if TYPE_CHECKING:
    from generator.plan.poses import PosePlan

_asked: list[tuple[Poses, HeadName]] = []
_files = count()


def plan_changed(scene: bpy.types.Scene) -> None:
    """Lay the plan on the timeline, or leave the timeline alone."""
    shown = scene.headturn
    if not shown.on_timeline:
        return
    _asked.clear()
    plan = _plan(shown)
    if plan is None:
        return
    frames = len(plan)
    scene.frame_start, scene.frame_end = 1, frames
    if not 1 <= scene.frame_current <= frames:
        scene.frame_set(1)
    show_frame(scene)
    _fit_timelines(scene)


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
    poses, head = settings.poses(shown), session.state.displayed or settings.chosen_head(shown)
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
    file, name = settings.cache_folder() / f"poses-{next(_files)}.npy", shown.id_data.name

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

# SPDX-License-Identifier: GPL-3.0-or-later
"""The 468 points of the pose that is shown: rendered and detected by the host, drawn by the overlay."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import session

if TYPE_CHECKING:
    from .properties import HeadturnSettings

SETTLE_S = 0.15
_wanted: list[str] = []


def pose_changed(shown: HeadturnSettings) -> None:
    """The points no longer fit; ask for new ones once the slider rests."""
    session.state.landmarks = None
    if not shown.show_landmarks or bpy.app.background:
        return
    _wanted[:] = [shown.id_data.name]
    if bpy.app.timers.is_registered(_ask):
        bpy.app.timers.unregister(_ask)
    bpy.app.timers.register(_ask, first_interval=SETTLE_S)


def request_pictures(
    shown: HeadturnSettings, poses: list[tuple[float, ...]], busy: str, on_answer: Any, **more: Any
) -> None:
    """Have the host render poses of the head that is shown, as a build would."""
    from . import settings, studio

    folder = Path(tempfile.gettempdir()) / f"headturn-pictures-{shown.id_data.name}"
    message = {
        "op": "pictures",
        "package": shown.package,
        "render": settings.to_config(shown)["render"],
        "distance_mm": studio.distance_mm(shown),
        "poses": [list(angles) for angles in poses],
        "folder": str(folder),
        "landmarks": True,
        **more,
    }
    session.request(message, busy, on_answer)


def _ask() -> float | None:
    from . import studio

    if session.is_busy():
        return SETTLE_S
    scene = bpy.data.scenes.get(_wanted[0])
    if scene is None or scene.headturn.head is None or not scene.headturn.show_landmarks:
        return None
    angles = studio.pose(scene.headturn)

    def take(answer: dict[str, Any]) -> None:
        session.state.landmarks = (angles, answer["landmarks"][0])
        session.redraw_views()

    request_pictures(scene.headturn, [angles], "", take)
    return None

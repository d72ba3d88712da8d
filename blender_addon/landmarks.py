# SPDX-License-Identifier: GPL-3.0-or-later
"""The 468 points of the pose that is shown: rendered and detected by the host, drawn by the overlay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

from generator.plan.settings import Values

from . import folders, keys, own, session, windows
from .core.conversation import OnAnswer
from .core.found import Points
from .session import Shown
from .settings import pose, radius_mm, still_config

SETTLE_S = 0.15
_wanted: list[str] = []


def pose_changed(shown: Shown) -> None:
    """The points no longer fit; ask for new ones once the slider rests."""
    if not shown.show_landmarks or bpy.app.background or keys.landmarks(shown) is not None:
        return
    _wanted[:] = [shown.id_data.name]
    if bpy.app.timers.is_registered(_ask):
        bpy.app.timers.unregister(_ask)
    bpy.app.timers.register(_ask, first_interval=SETTLE_S)


def request_pictures(
    shown: Shown,
    config: Values,
    poses: Sequence[tuple[float, ...]],
    busy: str,
    on_answer: OnAnswer,
    sheet: int = 0,
) -> None:
    """Have the host render poses of the head that is shown, as a build of config would, and find its face.

    sheet: columns of a picture that shows all of them; 0 for none.
    """
    message = {
        "op": "pictures",
        **folders.told(config),
        "package": shown.package,
        "head": "/".join(keys.viewed(shown)),
        "radius_mm": radius_mm(shown),
        "poses": [list(angles) for angles in poses],
        "folder": str(folders.scratch("pictures")),
        "landmarks": True,
        "sheet": sheet,
    }
    session.request(message, busy, on_answer)


def _ask() -> float | None:
    if session.conversation.is_busy:
        return SETTLE_S
    scene = bpy.data.scenes.get(_wanted[0])
    if scene is None or own.head(scene.headturn) is None or not scene.headturn.show_landmarks:
        return None
    angles, key = pose(scene.headturn), keys.at_pose(scene.headturn)

    def take(answer: dict[str, Any]) -> None:
        session.state.landmarks.take(key, Points(answer["landmarks"][0]))
        windows.redraw_views()

    request_pictures(scene.headturn, still_config(scene.headturn), [angles], "", take)
    return None

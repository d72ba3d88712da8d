# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows when a setting of the scene is edited: update and search functions of properties.py."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from . import session

if TYPE_CHECKING:
    from .properties import HeadturnSettings


def pose(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """A slider moved."""
    from . import studio

    studio.pose_changed(shown)


def look(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """Camera, light or preset."""
    from . import studio

    studio.look_changed(shown.id_data)


def plan(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """The poses of the dataset."""
    from . import timeline

    timeline.plan_changed(shown.id_data)


def view(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """How the 3D view is shaded."""
    from . import studio

    studio.show_views(shown)


def overlay(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """What is drawn over the 3D view."""
    session.redraw_views()


def choice(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """Which head is shown, or where its pose zero is."""
    from . import heads

    heads.show(shown)


def source(shown: HeadturnSettings, context: bpy.types.Context) -> None:
    """Which heads there are: what was found no longer counts."""
    if not session.is_quiet():
        session.state.heads, session.state.skipped, session.state.error = [], [], ""


def subjects(shown: HeadturnSettings, context: bpy.types.Context, text: str) -> list[str]:
    """For the search of the field."""
    return session.state.subjects()


def expressions(shown: HeadturnSettings, context: bpy.types.Context, text: str) -> list[str]:
    """For the search of the field."""
    return session.state.expressions(shown.subject)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows when a setting of the scene is edited: update and search functions of properties.py.

What acts is imported with the first edit: it takes numpy and the generator's scene code.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from . import keys, own, session, windows
from .session import Shown

Update = Callable[[Shown, bpy.types.Context], None]


def _unless_quiet(act: Callable[[Shown], None]) -> Update:
    def update(shown: Shown, context: bpy.types.Context) -> None:
        if not session.is_quiet():
            act(shown)

    return update


@_unless_quiet
def pose(shown: Shown) -> None:
    """A slider moved."""
    from . import studio

    studio.pose_changed(shown)


@_unless_quiet
def look(shown: Shown) -> None:
    """Camera, light or preset."""
    from . import studio

    studio.look_changed(shown.id_data)


@_unless_quiet
def look_seed(shown: Shown) -> None:
    """The seed of a look was typed."""
    if own.head(shown) is not None:
        from . import looks

        looks.show(shown)


@_unless_quiet
def plan(shown: Shown) -> None:
    """The poses of the dataset."""
    from . import timeline

    timeline.plan_changed(shown.id_data)


@_unless_quiet
def detection(shown: Shown) -> None:
    """How landmarks are found."""
    from . import landmarks

    landmarks.pose_changed(shown)


@_unless_quiet
def view(shown: Shown) -> None:
    """How the 3D view is shaded."""
    from . import studio

    studio.show_views(shown)


@_unless_quiet
def overlay(shown: Shown) -> None:
    """What is drawn over the 3D view."""
    windows.redraw_views()


@_unless_quiet
def choice(shown: Shown) -> None:
    """Which head is shown, or where its pose zero is."""
    from . import heads

    heads.show(shown)


@_unless_quiet
def source(shown: Shown) -> None:
    """Which heads there are: what was found of others is that of others."""
    session.state.error = ""


def choose_head(shown: Shown, place: int) -> None:
    """Show one of the gallery's heads."""
    from . import heads

    heads.choose(shown, *keys.listing(shown).heads[place])


def subjects(shown: Shown, context: bpy.types.Context, text: str) -> list[str]:
    """For the search of the field."""
    return keys.listing(shown).subjects()


def expressions(shown: Shown, context: bpy.types.Context, text: str) -> list[str]:
    """For the search of the field."""
    return keys.listing(shown).expressions(shown.subject)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of the source's heads, made one by one while nobody waits for the host."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from . import pictures, session
from .core import gallery
from .core.conversation import OnAnswer, Question
from .core.state import HeadName
from .session import Shown
from .settings import chosen_head, to_config

PIXELS = 128
_GROUP = "head/"
Item = tuple[str, str, str, int, int]
# Blender reads the texts of an enumeration after the function that made them has returned.
_items: list[Item] = []


def fill(shown: Shown) -> None:
    """Ask for the missing pictures around the shown head, the nearest first."""
    cache = Path(bpy.utils.extension_path_user(__package__, path="thumbnails", create=True))
    told = {"op": "thumbnail", "config": to_config(shown), "pixels": PIXELS, "cache": str(cache)}
    session.conversation.ask_later(
        Question(
            {**told, "subject": head[0], "expression": head[1]},
            _keeper(head),
            lambda reason: None,  # said when that head is chosen
        )
        for head in gallery.nearest(session.state.heads, chosen_head(shown))
        if not pictures.kept(_key(head))
    )


def forget() -> None:
    """Another source: its heads may have the same names."""
    session.conversation.ask_later(())
    pictures.forget_group(_GROUP)


def items(shown: Shown, context: bpy.types.Context) -> list[Item]:
    """The heads around the shown one as an enumeration with pictures, in the source's order."""
    none = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items["USER"].value
    heads = session.state.heads
    titles = gallery.titles(heads)
    _items[:] = [
        (str(place), titles[place], "Show this head", pictures.icon(_key(heads[place])) or none, place)
        for place in gallery.window(heads, chosen_head(shown))
    ]
    return _items


def chosen(shown: Shown) -> int:
    """Which of the items is shown."""
    return gallery.place_of(session.state.heads, chosen_head(shown))


def _key(head: HeadName) -> str:
    return f"{_GROUP}{'/'.join(head)}"


def _keeper(head: HeadName) -> OnAnswer:
    listed = session.state.heads

    def take(answer: dict[str, Any]) -> None:
        if session.state.heads is listed:
            pictures.keep(_key(head), Path(answer["picture"]))

    return take

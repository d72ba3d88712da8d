# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of the source's heads, made one by one while nobody waits for the host."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from . import folders, keys, pictures, session
from .core import gallery
from .core.conversation import OnAnswer, Question
from .core.found import HeadName
from .session import Shown
from .settings import chosen_head, to_config

PIXELS = 128
_GROUP = "head/"
Item = tuple[str, str, str, int, int]
# Blender reads the texts of an enumeration after the function that made them has returned.
_items: list[Item] = []


def fill(shown: Shown) -> None:
    """Ask for the missing pictures around the shown head, the nearest first."""
    config = to_config(shown)
    source = keys.source(config)
    cache = str(folders.lasting("thumbnails"))
    told = {"op": "thumbnail", **folders.told(config), "pixels": PIXELS, "cache": cache}
    session.conversation.ask_later(
        Question(
            {**told, "subject": head[0], "expression": head[1]},
            _keeper(source, head),
            lambda reason: None,  # said when that head is chosen
        )
        for head in gallery.nearest(keys.listing(shown).heads, chosen_head(shown))
        if not pictures.kept(key_of(source, head))
    )


def forget(source: str) -> None:
    """A source is read anew: its heads may look different."""
    session.conversation.ask_later(())
    pictures.forget_group(f"{_GROUP}{source}/")


def items(shown: Shown, context: bpy.types.Context) -> list[Item]:
    """The heads around the shown one as an enumeration with pictures, in the source's order."""
    none = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items["USER"].value
    heads, source = keys.listing(shown).heads, keys.source(to_config(shown))
    titles = gallery.titles(heads)
    _items[:] = [
        (
            str(place),
            titles[place],
            "Show this head",
            pictures.icon(key_of(source, heads[place])) or none,
            place,
        )
        for place in gallery.window(heads, chosen_head(shown))
    ]
    return _items


def chosen(shown: Shown) -> int:
    """Which of the items is shown."""
    return gallery.place_of(keys.listing(shown).heads, chosen_head(shown))


def key_of(source: str, head: HeadName) -> str:
    """Of a head's picture. source: see :func:`keys.source`."""
    return f"{_GROUP}{source}/{'/'.join(head)}"


def _keeper(source: str, head: HeadName) -> OnAnswer:
    listed = session.state.lists.of(source)

    def take(answer: dict[str, Any]) -> None:
        if session.state.lists.of(source) is listed:
            pictures.keep(key_of(source, head), Path(answer["picture"]))

    return take

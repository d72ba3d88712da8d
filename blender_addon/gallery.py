# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of the source's heads, made one by one while nobody waits for the host."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import pictures, session

if TYPE_CHECKING:
    from .properties import HeadturnSettings

AROUND = 50
"""How many heads before and after the shown one have their picture made: a source may hold thousands."""

PIXELS = 128
_GROUP = "head/"
# Blender reads the texts of an enumeration after the function that made them has returned.
_items: list[tuple[str, str, str, int, int]] = []


def fill(shown: HeadturnSettings) -> None:
    """Ask for the missing pictures around the shown head, the nearest first."""
    cache = Path(bpy.utils.extension_path_user(__package__, path="thumbnails", create=True))
    session.ask_later(
        session.Question(
            {
                "op": "thumbnail",
                "subject": subject,
                "expression": expression,
                "frame": shown.frame,
                "pixels": PIXELS,
                "cache": str(cache),
            },
            _keeper(subject, expression),
            lambda reason: None,  # said when that head is chosen
        )
        for subject, expression in _nearest(shown)
        if not pictures.kept(_key(subject, expression))
    )


def forget() -> None:
    """Another source: its heads may have the same names."""
    session.ask_later(())
    pictures.forget_group(_GROUP)


def items(shown: HeadturnSettings, context: bpy.types.Context) -> list[tuple[str, str, str, int, int]]:
    """The heads around the shown one as an enumeration with pictures, in the source's order."""
    none = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items["USER"].value
    heads = session.state.heads
    several = len({expression for _, expression in heads}) > 1
    _items[:] = [
        (
            str(index),
            f"{heads[index][0]} {heads[index][1]}" if several else heads[index][0],
            "Show this head",
            pictures.icon(_key(*heads[index])) or none,
            index,
        )
        for index in _window(shown)
    ]
    return _items


def chosen(shown: HeadturnSettings) -> int:
    """Which of the items is shown."""
    head = (shown.subject, shown.expression)
    return session.state.heads.index(head) if head in session.state.heads else 0


def choose(shown: HeadturnSettings, index: int) -> None:
    """Show one of the items."""
    from . import heads

    heads.choose(shown, *session.state.heads[index])


def _key(subject: str, expression: str) -> str:
    return f"{_GROUP}{subject}/{expression}"


def _window(shown: HeadturnSettings) -> range:
    middle = chosen(shown)
    return range(max(0, middle - AROUND), min(len(session.state.heads), middle + AROUND + 1))


def _nearest(shown: HeadturnSettings) -> list[tuple[str, str]]:
    middle = chosen(shown)
    order = sorted(_window(shown), key=lambda index: abs(index - middle))
    return [session.state.heads[index] for index in order]


def _keeper(subject: str, expression: str) -> Any:
    listed = session.state.heads

    def take(answer: dict[str, Any]) -> None:
        if session.state.heads is listed:
            pictures.keep(_key(subject, expression), Path(answer["picture"]))

    return take

# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings as rows of a panel: how each kind of them is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import bpy

from .core.numbers import Number
from .core.panel import Row
from .core.texts import Source, asks_for_folder
from .session import Shown
from .wrapping import label

Draw = Callable[[bpy.types.UILayout, Shown, Row], None]

NAMES = 0.22
"""Share of the width that the names of ranges take."""


def draw_rows(layout: bpy.types.UILayout, shown: Shown, rows: Iterable[Row]) -> None:
    """Draw rows; numbers that follow each other touch, as Blender draws them elsewhere."""
    column, before = layout, False
    for row in rows:
        touches = row.field.style in ("number", "numbers")
        if not touches:
            column = layout
        elif not before:
            column = layout.column(align=True)
        _DRAWN[row.field.style](column, shown, row)
        before = touches


def _plain(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    layout.prop(shown, row.field.drawn)


def _number(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    switch = row.field.switch if isinstance(row.field, Number) else None
    if switch is not None:
        layout.prop(shown, switch)
        layout = layout.row(align=True)
        layout.enabled = not getattr(shown, switch)
    layout.prop(shown, row.field.drawn)


def _numbers(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    if not row.parts:
        _number(layout.row(align=True), shown, row)
        return
    if row.header:
        cells = _columns(layout, "")
        for word in row.header:
            label(cells, word)
    cells = _columns(layout, row.field.words["name"])
    for place in range(row.parts):
        cells.prop(shown, row.field.drawn, index=place, text="")


def _columns(layout: bpy.types.UILayout, name: str) -> bpy.types.UILayout:
    line = layout.split(factor=NAMES, align=True)
    label(line, name)
    return line.row(align=True)


def _expanded(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    layout.row(align=True).prop(shown, row.field.name, expand=True)


def _flags(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    label(layout, row.field.words["name"])
    layout.grid_flow(columns=2, even_columns=True, align=True).prop(shown, row.field.name)


def _source(layout: bpy.types.UILayout, shown: Shown, row: Row) -> None:
    _expanded(layout, shown, row)
    if isinstance(row.field, Source) and asks_for_folder(getattr(shown, row.field.name)):
        layout.prop(shown, row.field.folder, text="")


_DRAWN: dict[str, Draw] = {
    "plain": _plain,
    "text": _plain,
    "menu": _plain,
    "number": _number,
    "numbers": _numbers,
    "expanded": _expanded,
    "flags": _flags,
    "source": _source,
}
"""By style of a field."""

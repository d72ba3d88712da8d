# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of ours in a layout: Blender's labels do not wrap, and it would translate some."""

from __future__ import annotations

import bpy

from .core.labels import wrapped
from .core.panel import Line

WIDTH_PER_CHARACTER = 7.2
"""Pixels at a UI scale of 1."""


def message(layout: bpy.types.UILayout, context: bpy.types.Context, line: Line, *, margin: int = 6) -> None:
    """A label of as many lines as the region's width needs; nothing is cut off. margin: characters."""
    scale = context.preferences.system.ui_scale
    characters = max(16, int(context.region.width / scale / WIDTH_PER_CHARACTER) - margin)
    column = layout.column(align=True)
    for number, text in enumerate(wrapped(line.text, characters)):
        label(column, text, line.icon if number == 0 else "BLANK1")


def label(layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """One line, in the language that it is written in."""
    layout.label(text=text, icon=icon, translate=False)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's windows: what is drawn anew, and windows of our own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from . import own


def redraw() -> None:
    """Redraw what shows words: the sidebars and the preferences. The 3D views stay: they cost most."""
    for area in _areas():
        if area.type == "PREFERENCES":
            area.tag_redraw()
        elif area.type == "VIEW_3D":
            for region in area.regions:
                if region.type == "UI":
                    region.tag_redraw()


def redraw_views() -> None:
    """Redraw the 3D views with all that lies over them."""
    for area in _areas():
        if area.type == "VIEW_3D":
            area.tag_redraw()


def keep_image(name: str, path: str) -> None:
    """Have the file at path as the image of this name, read anew."""
    image = own.kept(bpy.data.images, name)
    if image is None:
        image = bpy.data.images.load(path)
        own.keep(image, name)
        image.name = name
    if image.packed_files:
        image.unpack(method="REMOVE")
    image.filepath = path
    image.reload()
    image.pack()


def open_window(kind: str, slot: str, what: Any) -> None:
    """Show what in a window of its own. kind: of its area. slot: of the area's space."""
    bpy.ops.wm.window_new()
    area = bpy.context.window_manager.windows[-1].screen.areas[0]
    area.type = kind
    setattr(area.spaces.active, slot, what)


def _areas() -> Iterator[bpy.types.Area]:
    for window in bpy.context.window_manager.windows:
        yield from window.screen.areas

# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures for the panel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

SHEET = "sheet"
"""Of the outermost poses."""

LOOK, LOOKS = "look", "Headturn looks"
"""What the dice show, one or a sheet."""

_collections: list[Any] = []


def keep(key: str, path: Path) -> None:
    """Show the image file at path under key."""
    import bpy.utils.previews

    if not _collections:
        _collections.append(bpy.utils.previews.new())
    forget(key)
    _collections[0].load(key, str(path), "IMAGE", force_reload=True)


def kept(key: str) -> bool:
    """Is there one under key?"""
    return bool(_collections) and key in _collections[0]


def icon(key: str) -> int:
    """For template_icon; 0 if there is none, or no window."""
    return _collections[0][key].icon_id if kept(key) else 0


def forget(key: str) -> None:
    """Show nothing under key."""
    if kept(key):
        del _collections[0][key]


def forget_group(start: str) -> None:
    """Show nothing under any key that starts so."""
    for key in [key for collection in _collections for key in collection if key.startswith(start)]:
        forget(key)


def clear() -> None:
    """Forget all of them."""
    import bpy.utils.previews

    while _collections:
        bpy.utils.previews.remove(_collections.pop())

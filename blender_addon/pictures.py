# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures for the panel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_collections: list[Any] = []


def keep(key: str, path: Path) -> None:
    """Show the image file at path under key."""
    import bpy.utils.previews

    if not _collections:
        _collections.append(bpy.utils.previews.new())
    forget(key)
    _collections[0].load(key, str(path), "IMAGE", force_reload=True)


def icon(key: str) -> int:
    """For template_icon; 0 if there is none."""
    return _collections[0][key].icon_id if _collections and key in _collections[0] else 0


def forget(key: str) -> None:
    """Show nothing under key."""
    if _collections and key in _collections[0]:
        del _collections[0][key]


def clear() -> None:
    """Forget all of them."""
    import bpy.utils.previews

    while _collections:
        bpy.utils.previews.remove(_collections.pop())

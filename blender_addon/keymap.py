# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of ours, among those of Object Mode in Blender's preferences, where they can be changed."""

from __future__ import annotations

from typing import Any

import bpy

from .turn import TurnHead

_registered: list[tuple[Any, Any]] = []


def register() -> None:
    """R turns the head. Where that cannot be, in the user's own scenes, Blender's R follows."""
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is None:  # Blender has no window
        return
    keymap = keys.keymaps.new(name="Object Mode")  # where Blender has its R, too
    _registered.append((keymap, keymap.keymap_items.new(TurnHead.bl_idname, "R", "PRESS")))


def unregister() -> None:
    """Take them away."""
    while _registered:
        keymap, item = _registered.pop()
        keymap.keymap_items.remove(item)

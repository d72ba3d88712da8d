# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --background --command headturn ...``."""

from __future__ import annotations

from typing import Any

import bpy

from .session import host_preference, set_up

_registered: list[Any] = []


def _run(arguments: list[str]) -> int:
    from .core import headless

    return headless.run(arguments, preference=host_preference(), blender=bpy.app.binary_path, set_up=set_up())


def register() -> None:
    """Add the command."""
    _registered.append(bpy.utils.register_cli_command("headturn", _run))


def unregister() -> None:
    """Take the command away."""
    while _registered:
        bpy.utils.unregister_cli_command(_registered.pop())

# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes of ours, made known to Blender, and the one language that they speak.

Blender translates names that it knows, such as "Seed", and leaves others: a panel half in German. Words of
ours have a context that no catalogue has, so that all of them stay as they are written.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

WORDS = "Headturn"
"""Translation context of every word of ours."""

_registered: list[type] = []


def registering(*classes: type) -> tuple[Callable[[], None], Callable[[], None]]:
    """register() and unregister() of a module with these classes."""

    def register() -> None:
        for cls in classes:
            cls.bl_translation_context = WORDS  # type: ignore[attr-defined]
            bpy.utils.register_class(cls)
            _registered.append(cls)

    def unregister() -> None:
        for cls in reversed(classes):
            _registered.remove(cls)
            bpy.utils.unregister_class(cls)

    return register, unregister


def operators() -> list[Any]:
    """Operators of ours that somebody may look for by their names, in the order of registration."""
    return [
        cls
        for cls in _registered
        if issubclass(cls, bpy.types.Operator) and "INTERNAL" not in getattr(cls, "bl_options", ())
    ]

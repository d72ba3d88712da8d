# SPDX-License-Identifier: GPL-3.0-or-later
"""Headturn in Blender: a side panel, the grid on the timeline, a Build button, a headless command.

Thin adapters around the generator's own scene code and around the host, which does everything else; see
docs/blender.md. core/ knows no Blender. Nothing heavy is imported here: numpy and the generator's
scene code come in with the first click.
"""

from __future__ import annotations

from types import ModuleType


def _modules() -> tuple[ModuleType, ...]:
    """What is registered, in order. Imported when asked for: core/ is read where there is no bpy."""
    from . import (
        build_lines,
        build_operators,
        command,
        dropping,
        handlers,
        keymap,
        leaving,
        look_operators,
        menus,
        operators,
        panel,
        preferences,
        presets,
        properties,
        selected,
        setting_up,
        turn,
        waiting,
    )

    buttons = operators, turn, look_operators, build_operators, build_lines, waiting, setting_up, leaving
    tab = dropping, presets, menus, selected, panel
    return properties, preferences, *buttons, *tab, keymap, handlers, command


def register() -> None:
    """Called by Blender when the extension is enabled."""
    for module in _modules():
        module.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled, and when Blender ends."""
    from . import pictures, session

    session.forget()
    pictures.clear()
    for module in reversed(_modules()):
        module.unregister()

# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: no environment, then one that is named and checked, then heads that are not there."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, building, key, press_build, press_load, shown, state, to_the_end  # isort: skip
from ui_driver import EXTENSION, OUT, Step, area, click, drive, scroll, shot, widgets


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    python = os.environ.pop("HEADTURN_PYTHON")
    yield from begin()
    shot("01-empty")

    # Build without an environment: how to install one. Then its name, and Check.
    shown().out = str(OUT / "never")
    yield from to_the_end()
    yield from press_build()
    yield lambda: building.current.refused
    assert "pip install 'headturn[build]'" in state.error, state.error
    yield 0.3
    shot("02-no-environment")
    yield from key("ESC")  # closes the message
    yield from scroll(-60)
    yield from check_button(python)
    assert state.facts is not None and not state.host_error

    # The Load button, with a folder that does not exist: a message, no traceback.
    shown().heads_source = "FOLDER"
    shown().heads_source_folder = "/nowhere/heads"
    yield 0.3
    yield from press_load()
    yield lambda: bool(state.error)
    assert "/nowhere/heads" in state.error, state.error
    yield 0.3
    shot("04-no-such-folder")


def check_button(python: str) -> Iterator[Step]:
    """Name the environment in the preferences and press Check."""
    preferences = bpy.context.preferences
    view = area()
    view.type = "PREFERENCES"
    preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Headturn"
    bpy.ops.preferences.addon_expand(module=EXTENSION)
    preferences.addons[EXTENSION].preferences.python = python
    yield 0.5
    buttons = yield from widgets("buttons", "PREFERENCES", "WINDOW")
    yield from click(*buttons[0].middle)
    yield lambda: state.facts is not None or bool(state.host_error)
    yield 0.3
    shot("03-checked")
    view.type = "VIEW_3D"
    yield 0.3


drive(steps)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps that several sittings take. To be imported before ui_driver, which it finds."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ui_driver import EXTENSION, OUT, Step, area, click, key, open_tab, scroll, view_pixels, widgets

session = import_module(f"{EXTENSION}.session")
building = import_module(f"{EXTENSION}.building")
state = session.state


def shown() -> Any:
    """scene.headturn of the scene in the window; another one after undo, and after the first head."""
    return bpy.context.scene.headturn


def idle() -> bool:
    """Has the host answered everything that somebody waits for?"""
    return not session.conversation.is_busy


def begin() -> Iterator[Step]:
    """Blender as it starts, with our tab open."""
    yield from open_tab()
    area().spaces.active.overlay.show_cursor = False


def load_heads(count: int) -> Iterator[Step]:
    """Parametric heads, in a file that has a name, by the button."""
    shown().heads_source = "parametric"
    shown().heads_count, shown().heads_seed = count, 1
    bpy.ops.wm.save_as_mainfile(filepath=str(OUT / "heads.blend"))
    yield 0.3
    yield from press_load()
    yield lambda: bool(state.error) or shown().head is not None
    yield idle
    assert not state.error, state.error
    yield 0.5


def press_load() -> Iterator[Step]:
    """Press Load Heads, the first button of the tab."""
    load, *_ = yield from widgets("buttons")
    yield from click(*load.middle)


def press_build() -> Iterator[Step]:
    """Press Build or Cancel, which stands out by its height."""
    found = yield from widgets("buttons")
    yield from click(*max(found, key=lambda widget: widget.top - widget.bottom).middle)


def to_the_end() -> Iterator[Step]:
    """Scroll down to the Build panel."""
    yield from scroll(60)


def axis_pixels(image: np.ndarray) -> int:
    """How many pixels of the 3D view have the colour of the axis to the front."""
    blue = np.array(import_module(f"{EXTENSION}.overlay").BLUE[:3])
    return int((np.abs(view_pixels(image) - blue).max(axis=2) < 0.06).sum())


__all__ = [
    "axis_pixels",
    "begin",
    "building",
    "idle",
    "key",
    "load_heads",
    "press_build",
    "press_load",
    "session",
    "shown",
    "state",
    "to_the_end",
]

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

from ui_driver import EXTENSION, OUT, Step, area, click, event, key, open_tab, scroll, view_pixels, widgets

session = import_module(f"{EXTENSION}.session")
building = import_module(f"{EXTENSION}.building")
keys = import_module(f"{EXTENSION}.keys")
state = session.state


def shown() -> Any:
    """scene.headturn of the scene in the window; another one after undo, and after the first head."""
    return bpy.context.scene.headturn


def listing() -> Any:
    """The heads of the source that is named."""
    return keys.listing(shown())


def look() -> Any:
    """What the dice showed, None if that is of something else."""
    return keys.look(shown())


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


def answer(name: str) -> Iterator[Step]:
    """Press a key over a question in the middle of the window."""
    x, y = bpy.context.window.width // 2, bpy.context.window.height // 2
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.2
    event(name, "PRESS", x, y)
    event(name, "RELEASE", x, y)
    yield 0.5


def to_the_end() -> Iterator[Step]:
    """Scroll down to the Build panel."""
    yield from scroll(60)


def fold(*closed: str) -> Iterator[Step]:
    """Have these panels closed, by the names of their classes, and all others open."""
    panel = import_module(f"{EXTENSION}.panel")
    panel.unregister()
    for cls in vars(panel).values():
        if isinstance(cls, type) and issubclass(cls, bpy.types.Panel) and hasattr(cls, "bl_idname"):
            cls.bl_options = {"DEFAULT_CLOSED"} if cls.__name__ in closed else set()
            cls.bl_idname += "x"  # Blender remembers which panels were closed, by their names
            if hasattr(cls, "bl_parent_id"):
                cls.bl_parent_id += "x"
    panel.register()
    yield 0.5
    yield from scroll(-60)


def axis_pixels(image: np.ndarray) -> int:
    """How many pixels of the 3D view have the colour of the axis to the front."""
    blue = np.array(import_module(f"{EXTENSION}.overlay").BLUE[:3])
    return int((np.abs(view_pixels(image) - blue).max(axis=2) < 0.06).sum())


__all__ = [
    "answer",
    "axis_pixels",
    "begin",
    "building",
    "fold",
    "idle",
    "key",
    "keys",
    "listing",
    "load_heads",
    "look",
    "press_build",
    "press_load",
    "session",
    "shown",
    "state",
    "to_the_end",
]

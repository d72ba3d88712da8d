# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside a Blender with a window: steps one after another, with real events and screenshots.

A script of steps is a generator function. It yields a number (seconds to wait)
or a function (wait until it is true); between two yields Blender redraws and
handles events. Used with ``blender --enable-event-simulate --python script.py``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np

OUT = Path(os.environ["HEADTURN_TEST_OUT"])
EXTENSION = "bl_ext.user_default.headturn"
DEADLINE_S = 60.0
Step = float | Callable[[], bool]

MARK = (0.0, 1.0, 0.0)
_BEGAN = time.monotonic()


class Widget(NamedTuple):
    """Edges in window coordinates, pixels from the lower left."""

    left: int
    right: int
    bottom: int
    top: int

    @property
    def middle(self) -> tuple[int, int]:
        """Where to click."""
        return (self.left + self.right) // 2, (self.bottom + self.top) // 2


def drive(script: Callable[[], Iterator[Step]]) -> None:
    """Run the steps, write OUT/passed, end Blender. Any failure ends it with exit code 9."""
    steps = script()
    began = [0.0]
    waiting: list[Callable[[], bool]] = []

    def tick() -> float | None:
        # Exceptions inside a timer never reach the exit code.
        try:
            if waiting:
                if not waiting[0]():
                    if time.monotonic() - began[0] > DEADLINE_S:
                        shot("deadline")
                        raise TimeoutError(f"waited {DEADLINE_S:.0f} s for {waiting[0]}")
                    return 0.1
                waiting.clear()
            step = next(steps)
            if callable(step):
                waiting.append(step)
                began[0] = time.monotonic()
                return 0.1
            return float(step)
        except StopIteration:
            (OUT / "passed").touch()
            _end(0)
        except BaseException:
            traceback.print_exc()
            _end(9)
        return None

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)  # another file is no end


def shot(name: str, suffix: str = ".png") -> np.ndarray:
    """Write the whole window to OUT; returns it as float [H, W, 3] from the top, 0-1."""
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    path = OUT / f"{name}{suffix}"
    subprocess.run(["import", "-window", "root", str(path)], check=True)
    said = subprocess.run(["convert", str(path), "-depth", "8", "ppm:-"], check=True, capture_output=True)
    _, size, _, pixels = said.stdout.split(b"\n", 3)
    width, height = map(int, size.split())
    print(f"{time.monotonic() - _BEGAN:6.1f} s  {name}", flush=True)
    return np.frombuffer(pixels, dtype=np.uint8).reshape(height, width, 3) / 255.0


def area(kind: str = "VIEW_3D") -> bpy.types.Area:
    """The first area of a kind."""
    return next(a for a in bpy.context.window.screen.areas if a.type == kind)


def region(kind: str = "UI", of: str = "VIEW_3D") -> bpy.types.Region:
    """A region of the first area of a kind."""
    return next(r for r in area(of).regions if r.type == kind)


def view_pixels(image: np.ndarray) -> np.ndarray:
    """The part of a screenshot that shows the 3D view, without the sidebar."""
    view, side = region("WINDOW"), region("UI")
    height = bpy.context.window.height
    return image[height - view.y - view.height : height - view.y, view.x : side.x]


def widgets(kind: str, area_kind: str = "VIEW_3D", region_kind: str = "UI") -> Iterator[Step]:
    """A region's "sliders" or "buttons" wider than a tenth of it, from the top; by default the sidebar's.

    To be used as ``found = yield from widgets("sliders")``. Blender does not say where
    a widget is, so for one picture they get a colour of their own.
    """
    place = region(region_kind, area_kind)
    # To the left of it: a widget under the mouse is lighter.
    event("MOUSEMOVE", "NOTHING", max(place.x - 200, 2), place.y + place.height // 2)
    yield 0.1
    theme = bpy.context.preferences.themes[0].user_interface
    looks = theme.wcol_numslider if kind == "sliders" else theme.wcol_tool
    names = ("inner", "inner_sel", "item", "outline", "text", "text_sel")
    before = [tuple(getattr(looks, name)) for name in names] + [looks.show_shaded]
    for name in names:
        length = len(getattr(looks, name))
        setattr(looks, name, ((0.0, 0.0, 0.0) if name == "outline" else MARK)[:3] + (1.0,) * (length - 3))
    looks.show_shaded = False
    image = shot("widgets", ".ppm")
    for name, value in zip(names, before, strict=False):
        setattr(looks, name, value)
    looks.show_shaded = before[-1]
    height = bpy.context.window.height
    there = np.abs(image - np.array(MARK)).max(axis=2) < 0.1
    there[:, : place.x] = there[:, place.x + place.width :] = False
    there[: height - place.y - place.height] = there[height - place.y :] = False
    rows = np.append(there.sum(axis=1) > place.width / 10, False)
    edges = np.flatnonzero(np.diff(rows.astype(int), prepend=0))
    found = []
    for first, end in edges.reshape(-1, 2):
        columns = np.flatnonzero(there[(first + end) // 2])
        if end - first >= 8 and len(columns):
            found.append(Widget(int(columns[0]), int(columns[-1]), height - int(end), height - int(first)))
    return found


def event(kind: str, value: str, x: int, y: int, **more: object) -> None:
    """One event, as if a hand made it."""
    bpy.context.window.event_simulate(type=kind, value=value, x=x, y=y, **more)


def click(x: int, y: int) -> Iterator[Step]:
    """Press and release the left button."""
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.2
    event("LEFTMOUSE", "PRESS", x, y)
    yield 0.1
    event("LEFTMOUSE", "RELEASE", x, y)
    yield 0.3


def drag(x: int, y: int, to_x: int, to_y: int) -> Iterator[Step]:
    """Drag with the left button."""
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.2
    event("LEFTMOUSE", "PRESS", x, y)
    yield 0.1
    for k in range(1, 9):
        event("MOUSEMOVE", "NOTHING", x + (to_x - x) * k // 8, y + (to_y - y) * k // 8)
        yield 0.05
    event("LEFTMOUSE", "RELEASE", to_x, to_y)
    yield 0.3


def type_value(x: int, y: int, text: str) -> Iterator[Step]:
    """Double-click a field, replace its text, confirm."""
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.2
    for value in ("PRESS", "RELEASE", "DOUBLE_CLICK", "RELEASE"):
        event("LEFTMOUSE", value if value != "DOUBLE_CLICK" else "PRESS", x, y)
        yield 0.02
    yield 0.3
    event("A", "PRESS", x, y, ctrl=True)
    event("A", "RELEASE", x, y)
    yield 0.1
    yield from strike(text, x, y)
    event("RET", "PRESS", x, y)
    event("RET", "RELEASE", x, y)
    yield 0.3


def strike(text: str, x: int, y: int) -> Iterator[Step]:
    """Type letters, digits, a minus, a point, with the mouse here."""
    digits = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
    names = {" ": "SPACE", "-": "MINUS", ".": "PERIOD", **{str(k): name for k, name in enumerate(digits)}}
    for character in text:
        name = names.get(character, character.upper())
        event(name, "PRESS", x, y, unicode=character)
        event(name, "RELEASE", x, y)
        yield 0.05


def open_tab() -> Iterator[Step]:
    """Show the Headturn tab, wide enough to read."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.smooth_view = 0
    event("ESC", "PRESS", 400, 300)
    event("ESC", "RELEASE", 400, 300)
    yield 0.3
    area().spaces.active.show_region_ui = True
    yield 0.5
    region("UI").active_panel_category = "Headturn"
    area().tag_redraw()
    yield 0.5


def scroll(steps: int) -> Iterator[Step]:
    """Turn the wheel over the sidebar, down for steps above zero."""
    side = region("UI")
    x, y = side.x + side.width // 3, side.y + side.height // 2
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.1
    for _ in range(abs(steps)):
        event("WHEELDOWNMOUSE" if steps > 0 else "WHEELUPMOUSE", "PRESS", x, y)
        yield 0.02
    yield 0.3


def key(name: str, **more: object) -> Iterator[Step]:
    """Press a key over the 3D view."""
    view = region("WINDOW")
    x, y = view.x + view.width // 4, view.y + view.height // 2
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.1
    event(name, "PRESS", x, y, **more)
    event(name, "RELEASE", x, y, **more)
    yield 0.4


def _end(code: int) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: landmarks of the pose shown, the extremes, the look of the build, the gallery of heads."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, idle, key, load_heads, shown, state  # isort: skip
from ui_driver import EXTENSION, Step, click, drive, scroll, shot, view_pixels, widgets


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    yield from begin()
    yield from load_heads(2)

    # Landmarks of the pose that is shown, and the extremes.
    shown().yaw, shown().pitch, shown().roll = 20, 5, 0
    shown().show_landmarks = True
    yield lambda: state.landmarks is not None
    assert len(state.landmarks[1]) == 468
    yield 0.3
    shot("09-landmarks")
    shown().show_landmarks = False
    assert bpy.ops.headturn.preview_extremes() == {"FINISHED"}
    yield idle
    assert state.extremes, state.error
    yield from scroll(10)
    yield 0.5
    shot("10-extremes")
    yield from scroll(-60)

    # As rendered: the light of the build, and what changes it.
    shown().viewport = "RENDERED"
    yield 1.5
    bright = view_pixels(shot("11-as-rendered"))
    made = shown().head.data.as_pointer()
    shown().render_light_yaw_deg, shown().render_ambient = -80, 0.0
    shown().render_background = (0.1, 0.2, 0.6)
    yield 1.5
    dark = view_pixels(shot("11-another-light"))
    assert float((np.abs(dark - bright).max(axis=2) > 0.1).mean()) > 0.2
    assert shown().head.data.as_pointer() == made, "the light is set, nothing is built anew"
    shown().viewport = "SOLID"
    yield from open_all_panels()
    yield from scroll(27)
    shot("20-look")
    yield from scroll(-60)
    shown().heads_source = "FOLDER"
    shown().poses_kind = "sobol"
    yield 0.3
    shot("21-folder")
    yield from scroll(12)
    shot("22-random-poses")
    shown().heads_source, shown().poses_kind = "parametric", "grid"
    for name in ("light_yaw_deg", "ambient", "background"):
        shown().property_unset(f"render_{name}")
    yield from close_panels()

    # The next subject, from the pictures of all of them.
    bpy.ops.headturn.load_heads()
    yield idle
    yield lambda: len(state.heads) == 2
    yield idle
    first = shown().subject
    kept = import_module(f"{EXTENSION}.pictures").kept
    yield lambda: all(kept(f"head/{subject}/neutral") for subject in state.subjects())
    yield 0.3
    load, *_ = yield from widgets("buttons")
    yield from click(load.left + 28, load.bottom - 73)
    yield 0.5
    shot("12-gallery")
    yield from key("ESC")
    shown().gallery = "1"
    yield idle
    assert shown().subject != first and shown().gallery == "1" and not state.error
    assert state.displayed == (shown().subject, "neutral")


def open_all_panels() -> Iterator[Step]:
    """Panels that are closed at first are open from now on."""
    yield from _register_panels(set())


def close_panels() -> Iterator[Step]:
    """As they are at first."""
    yield from _register_panels({"DEFAULT_CLOSED"})


def _register_panels(options: set[str]) -> Iterator[Step]:
    panel = import_module(f"{EXTENSION}.panel")
    panel.unregister()
    for cls in (panel.SelectionPanel, panel.LookPanel):
        cls.bl_options = options
        cls.bl_idname += "_"  # Blender remembers which panels were closed, by their names
    panel.register()
    yield 0.5
    yield from scroll(-60)


drive(steps)

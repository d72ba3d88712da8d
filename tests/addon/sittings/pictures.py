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

from ui_steps import begin, fold, idle, key, keys, listing, load_heads, shown, state  # isort: skip
from ui_driver import EXTENSION, Step, click, drive, scroll, shot, view_pixels, widgets


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    yield from begin()
    yield from load_heads(2)

    # Landmarks of the pose that is shown, and the extremes.
    shown().yaw, shown().pitch, shown().roll = 20, 5, 0
    shown().show_landmarks = True
    yield lambda: keys.landmarks(shown()) is not None
    assert len(keys.landmarks(shown()).points) == 468
    yield 0.3
    shot("09-landmarks")
    shown().show_landmarks = False
    assert bpy.ops.headturn.preview_extremes() == {"FINISHED"}
    yield idle
    assert keys.extremes(shown()), state.error
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
    yield lambda: changed(bright, "11-another-light") > 0.2
    assert shown().head.data.as_pointer() == made, "the light is set, nothing is built anew"
    shown().viewport = "SOLID"
    yield from fold("LampsPanel", "WornPanel", "SensorPanel")
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
    yield from fold("SelectionPanel", "LookPanel")

    # The next subject, from the pictures of all of them.
    bpy.ops.headturn.load_heads()
    yield idle
    yield lambda: len(listing().heads) == 2
    yield idle
    first = shown().subject
    kept = import_module(f"{EXTENSION}.pictures").kept
    key_of, source = import_module(f"{EXTENSION}.gallery").key_of, keys.placed(shown()).source
    yield lambda: all(kept(key_of(source, head)) for head in listing().heads)
    yield 0.3
    load, *_ = yield from widgets("buttons")
    yield from click(load.left + 28, load.bottom - 73)
    yield 0.5
    shot("12-gallery")
    yield from key("ESC")
    shown().gallery = "1"
    yield idle
    assert shown().subject != first and shown().gallery == "1" and not state.error
    assert keys.viewed(shown()) == (shown().subject, "neutral")


def changed(before: np.ndarray, name: str) -> float:
    """Share of the 3D view that is not as it was. Rendering takes as long as it takes."""
    return float((np.abs(view_pixels(shot(name)) - before).max(axis=2) > 0.1).mean())


drive(steps)

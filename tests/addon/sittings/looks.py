# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: the dice are thrown, a seed is typed, a sheet is drawn, a distribution is written."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, fold, idle, load_heads, look, shown, state  # isort: skip
from ui_driver import EXTENSION, OUT, Step, click, drive, scroll, shot, widgets

RENDER_WAIT = 0.5


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    yield from begin()
    yield from load_heads(1)
    pictures = import_module(f"{EXTENSION}.pictures")
    shown().render_resolution = 256
    shown().yaw, shown().pitch, shown().roll = 20, -5, 0
    assert look() is None and not pictures.kept(pictures.LOOK)

    # The button: a picture, a seed, and the value of every draw.
    yield from to_the_looks()
    roll, *_ = yield from widgets("buttons")
    yield from click(*roll.middle)
    yield lambda: look() is not None or bool(state.error)
    yield idle
    assert not state.error, state.error
    assert look().seed == shown().look_seed and pictures.kept(pictures.LOOK)
    assert len(look().values()) > 15
    yield RENDER_WAIT
    shot("30-look")

    # Another throw, with the mouse where it is.
    before = look()
    yield from click(*roll.middle)
    yield lambda: look() is not before
    yield idle

    # A seed that is typed is its look; the same one again is the same.
    thrown = look()
    shown().look_seed = 7
    yield lambda: look().seed == 7
    yield idle
    seven = look()
    picture = keep("seven")
    assert seven.drawn != thrown.drawn
    yield RENDER_WAIT
    shot("31-seven")
    assert bpy.ops.headturn.roll_dice() == {"FINISHED"}
    yield lambda: look() is not seven
    yield idle
    assert keep("other") != picture
    shown().look_seed = 7
    yield lambda: look().seed == 7
    yield idle
    assert look() == seven and keep("again") == picture

    # Another pose is another row: the panel says so, until the look is shown again.
    panel = import_module(f"{EXTENSION}.core.panel")
    settings = import_module(f"{EXTENSION}.settings")
    shown().yaw = -10
    assert panel.look(look(), settings.pose(shown())).icon == "INFO"
    assert bpy.ops.headturn.show_look() == {"FINISHED"}
    yield lambda: look() != seven
    yield idle
    assert panel.look(look(), settings.pose(shown())).icon == "CHECKMARK"

    # A sheet; and what is drawn where it is written down.
    assert bpy.ops.headturn.look_sheet() == {"FINISHED"}
    yield lambda: pictures.LOOKS in bpy.data.images
    yield idle
    assert tuple(bpy.data.images[pictures.LOOKS].size) == (3 * 256, 3 * 256)
    bpy.data.images[pictures.LOOKS].save(filepath=str(OUT / "sheet.png"))
    yield RENDER_WAIT
    yield from scroll(60)
    shot("32-sheet")
    shown().draws = "ambient=uniform:0.1,0.9 background=uniform:0,1;0.5;0.5"
    assert bpy.ops.headturn.show_look() == {"FINISHED"}
    yield lambda: look() is not None and {*look().drawn} == {"ambient", "background"}
    shown().draws = "ambient=uniform:0.9,0.1"
    assert bpy.ops.headturn.show_look() == {"FINISHED"}
    yield lambda: "the low end 0.9 is above the high end 0.1" in state.error
    shown().draws = ""

    facts = {"head": "/".join(seven.head), "pose": seven.pose, "seed": 7, "drawn": seven.drawn}
    (OUT / "facts.json").write_text(json.dumps(facts), encoding="utf-8")


def to_the_looks() -> Iterator[Step]:
    """Fold the panels before and after it, so that Roll the Dice is the first button."""
    yield from fold("HeadsPanel", "PosePanel", "PosesPanel", "LookPanel", "BuildPanel")


def keep(name: str) -> bytes:
    """The picture of the look, kept for whoever wants to see it."""
    import_module(f"{EXTENSION}.looks")
    file = import_module(f"{EXTENSION}.folders").scratch("look") / "000.png"
    shutil.copyfile(file, OUT / f"{name}.png")
    return file.read_bytes()


drive(steps)

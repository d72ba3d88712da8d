# SPDX-License-Identifier: GPL-3.0-or-later
"""One sitting in Blender's window: load heads, turn them, scrub, preview, build, cancel, go wrong."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ui_driver import (
    EXTENSION,
    OUT,
    Step,
    area,
    click,
    drag,
    drive,
    key,
    open_tab,
    region,
    scroll,
    shot,
    type_value,
    view_pixels,
    widgets,
)

facts: dict[str, object] = {}


def session() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    module = sys.modules[f"{EXTENSION}.session"]
    building = sys.modules[f"{EXTENSION}.building"]
    state = module.state
    own = bpy.context.scene
    python = os.environ.pop("HEADTURN_PYTHON")

    yield from open_tab()
    area().spaces.active.overlay.show_cursor = False
    shot("01-empty")

    # Build without an environment: how to install one. Then its name, and Check.
    bpy.context.scene.headturn.out = str(OUT / "never")
    yield from scroll(40)
    yield from _click_tallest()
    yield lambda: building.current.refused
    assert "pip install 'headturn[build]'" in state.error, state.error
    yield 0.3
    shot("02-no-environment")
    yield from key("ESC")  # closes the message
    yield from scroll(-40)
    yield from _check_button(python)
    assert state.facts is not None and not state.host_error

    # The Load button, with a folder that does not exist: a message, no traceback.
    bpy.context.scene.headturn.source = "FOLDER"
    bpy.context.scene.headturn.folder = "/nowhere/heads"
    yield 0.3
    load, *_ = yield from widgets("buttons")
    yield from click(*load.middle)
    yield lambda: bool(state.error)
    assert "/nowhere/heads" in state.error, state.error
    yield 0.3
    shot("04-no-such-folder")

    # Parametric heads, in a file that has a name.
    bpy.context.scene.headturn.source = "PARAMETRIC"
    bpy.context.scene.headturn.count, bpy.context.scene.headturn.seed = 2, 1
    bpy.ops.wm.save_as_mainfile(filepath=str(OUT / "heads.blend"))
    yield 0.3
    load, *_ = yield from widgets("buttons")
    yield from click(*load.middle)
    yield lambda: bool(state.error) or bpy.context.scene.headturn.head is not None
    yield lambda: not module.is_busy()
    assert not state.error, state.error
    assert bpy.context.scene != own, "the user's own scene must stay as it was"
    assert [o.name for o in own.objects] == ["Cube", "Light", "Camera"] or len(own.objects) == 3
    shown = bpy.context.scene.headturn
    assert shown.subject and shown.expression == "neutral"
    yield 0.5
    before = view_pixels(shot("05-loaded"))
    assert len(state.subjects()) == 2

    # A slider turns the head in the pixels and rebuilds nothing.
    mesh, material = shown.head.data.as_pointer(), shown.head.data.materials[0].as_pointer()
    yaw, pitch, *_ = yield from widgets("sliders")
    x, y = yaw.middle
    yield from drag(x, y, x + 60, y)
    assert shown.yaw > 5, shown.yaw
    after = view_pixels(shot("06-slider"))
    changed = float((np.abs(after - before).max(axis=2) > 0.1).mean())
    assert changed > 0.05, f"{changed:.1%} of the view changed"
    assert (shown.head.data.as_pointer(), shown.head.data.materials[0].as_pointer()) == (mesh, material)
    facts["changed"] = changed

    # A typed value, and undo.
    yield from type_value(*pitch.middle, "-12.5")
    assert shown.pitch == -12.5, shown.pitch
    turned = np.array(shown.head.matrix_world)
    shot("07-typed")
    yield from key("Z", ctrl=True)
    yield lambda: bpy.context.scene.headturn.pitch == 0.0
    shown = bpy.context.scene.headturn
    assert shown.yaw > 5, shown.yaw
    assert np.abs(np.array(shown.head.matrix_world) - turned).max() > 0.05
    yield from key("Z", ctrl=True, shift=True)
    yield lambda: bpy.context.scene.headturn.pitch == -12.5
    shown = bpy.context.scene.headturn
    assert np.abs(np.array(shown.head.matrix_world) - turned).max() < 1e-6

    # Snapping.
    shown.snap = True
    shown.pitch = 13.0
    assert (shown.pitch, shown.yaw % 10) == (10.0, 0.0)
    shown.snap = False

    # The grid on the timeline: dragging in the timeline scrubs.
    shown.on_timeline = True
    yield 0.3
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (1, 693)
    assert (shown.yaw, shown.pitch, shown.roll) == (-50, -40, -30)
    line = region("WINDOW", "DOPESHEET_EDITOR")
    top = line.y + line.height - 10
    yield from drag(line.x + line.width // 2, top, line.x + line.width // 4, top)
    assert scene.frame_current > 1
    index = scene.frame_current - 1
    expected = (-50 + 10 * (index // 63), -40 + 10 * (index // 7 % 9), -30 + 10 * (index % 7))
    assert (shown.yaw, shown.pitch, shown.roll) == expected, (scene.frame_current, expected)
    shot("08-timeline")
    shown.on_timeline = False

    # Landmarks of the pose that is shown, and the extremes.
    shown.yaw, shown.pitch, shown.roll = 20, 5, 0
    shown.show_landmarks = True
    yield lambda: state.landmarks is not None
    assert len(state.landmarks[1]) == 468
    yield 0.3
    shot("09-landmarks")
    shown.show_landmarks = False
    assert bpy.ops.headturn.preview_extremes() == {"FINISHED"}
    yield lambda: not module.is_busy()
    assert state.extremes, state.error
    yield from scroll(6)
    yield 0.5
    shot("10-extremes")
    yield from scroll(-30)
    shown.viewport = "RENDERED"
    yield 1.5
    shot("11-as-rendered")
    shown.viewport = "SOLID"

    # The next subject, from the pictures of all of them.
    first = shown.subject
    kept = sys.modules[f"{EXTENSION}.pictures"].kept
    yield lambda: all(kept(f"head/{subject}/neutral") for subject in state.subjects())
    load, *_ = yield from widgets("buttons")
    yield from click(load.left + 28, load.bottom - 73)
    yield 0.5
    shot("12-gallery")
    yield from key("ESC")
    shown.gallery = "1"
    yield lambda: not module.is_busy()
    shown = bpy.context.scene.headturn
    assert shown.subject != first and shown.gallery == "1" and not state.error
    assert state.displayed == (shown.subject, "neutral")
    yield 0.3

    # Build a tiny dataset with the button.
    for name in ("yaw", "pitch", "roll"):
        setattr(shown, f"{name}_range", (0, 0, 10))
    shown.yaw_range, shown.resolution, shown.workers = (-20, 20, 20), 64, 1
    shown.out = "//tiny"
    bpy.ops.headturn.save_config(filepath=str(OUT / "saved.toml"))
    yield from scroll(40)
    yield from _click_tallest()
    assert building.current.runs or module.state.checking
    yield lambda: building.current.exit_code is not None
    assert building.current.exit_code == 0, building.current.headline()
    yield from scroll(40)
    assert area().spaces.active.region_3d.view_perspective == "CAMERA"
    shot("13-built")
    facts["rows"] = building.current.progress.result["rows"]

    # A long one, ended with Esc: what is there stays, and the folder can be continued.
    shown.yaw_range, shown.pitch_range, shown.roll_range = (-50, 50, 1), (-40, 40, 1), (-30, 30, 10)
    shown.resolution = 128
    shown.out = "//long"
    yield 0.3
    yield from _click_tallest()
    yield lambda: building.current.runs and building.current.progress.stage == "rendering"
    yield lambda: building.current.progress.done > 0
    yield from scroll(40)
    shot("14-building")
    yield from key("ESC")
    yield lambda: not building.current.runs
    assert building.current.cancelled and building.current.exit_code not in (0, 3)
    yield from scroll(40)
    shot("15-cancelled")

    # Build goes on where that ended; this time the Cancel button, in the same place.
    yield from _click_tallest()
    yield lambda: building.current.runs and building.current.progress.stage == "rendering"
    yield from scroll(40)
    yield from _click_tallest()
    yield lambda: not building.current.runs
    assert building.current.cancelled and not (OUT / "long" / "manifest.json").exists()

    # A folder that holds something else.
    (OUT / "foreign").mkdir()
    (OUT / "foreign" / "diary.txt").write_text("mine", encoding="utf-8")
    shown.out = "//foreign"
    yield 0.3
    yield from _click_tallest()
    yield lambda: building.current.exit_code is not None and not building.current.cancelled
    assert building.current.exit_code == 1 and "foreign" in building.current.headline()
    yield from scroll(40)
    shot("16-refused")
    assert "foreign" in bpy.data.texts["Headturn report"].as_string()

    # Off and on again: the axes go and come back.
    import addon_utils

    seen = _axis_pixels(shot("17-before"))
    addon_utils.disable(EXTENSION)
    assert not hasattr(bpy.types.Scene, "headturn")
    yield 0.3
    gone = _axis_pixels(shot("18-disabled"))
    addon_utils.enable(EXTENSION)
    yield 0.3
    yield 0.3  # a redraw may take longer than that, and ours comes after it
    back = _axis_pixels(shot("19-enabled-again"))
    assert seen > 150 and gone < 10 and back > 0.9 * seen, (seen, gone, back)
    (OUT / "facts.json").write_text(json.dumps(facts), encoding="utf-8")


def _check_button(python: str) -> Iterator[Step]:
    """Name the environment in the preferences and press Check."""
    state = sys.modules[f"{EXTENSION}.session"].state
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
    yield lambda: state.facts is not None or state.host_error
    yield 0.3
    shot("03-checked")
    view.type = "VIEW_3D"
    yield 0.3


def _axis_pixels(image: np.ndarray) -> int:
    """How many pixels of the 3D view have the colour of the axis to the front."""
    blue = np.array(sys.modules[f"{EXTENSION}.overlay"].BLUE[:3])
    return int((np.abs(view_pixels(image) - blue).max(axis=2) < 0.06).sum())


def _click_tallest() -> Iterator[Step]:
    """Click Build or Cancel, which stands out by its height."""
    found = yield from widgets("buttons")
    yield from click(*max(found, key=lambda widget: widget.top - widget.bottom).middle)


drive(session)

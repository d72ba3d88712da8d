# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: build, let a build outlive file and window, end it, go on, a folder that is somebody else's."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import answer, begin, building, idle, key, keys, listing, load_heads, press_build, press_load  # isort: skip
from ui_steps import session, shown, state, to_the_end  # isort: skip
from ui_driver import EXTENSION, OUT, Step, area, drive, event, scroll, shot, view_pixels


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    build = building.current
    folders = import_module(f"{EXTENSION}.folders")
    yield from begin()

    # Heads take a while: how far it is, and a way out, after which others are loaded.
    shown().heads_source, shown().heads_count = "parametric", 60
    yield from press_load()
    yield lambda: session.conversation.progress.done > 0
    assert session.conversation.busy.startswith("making heads "), session.conversation.busy
    yield 0.3
    shot("12-loading")
    assert bpy.ops.headturn.stop_waiting() == {"FINISHED"}
    assert idle() and not state.error and not bpy.ops.headturn.stop_waiting.poll()
    yield from load_heads(2)

    # Build a tiny dataset with the button.
    for name in ("yaw", "pitch", "roll"):
        setattr(shown(), f"poses_{name}", (0, 0, 10))
    shown().poses_yaw, shown().render_resolution, shown().workers = (-20, 20, 20), 64, 1
    shown().out = "//tiny"
    bpy.ops.headturn.save_config(filepath=str(OUT / "saved.toml"))
    yield from to_the_end()
    yield from press_build()
    assert build.runs or session.state.checking
    yield lambda: build.exit_code is not None
    assert build.exit_code == 0, build.headline()
    yield from to_the_end()
    assert area().spaces.active.region_3d.view_perspective == "CAMERA"
    seen_before = view_pixels(shot("13-built"))
    assert bpy.ops.headturn.contact_sheet() == {"FINISHED"}
    assert bpy.data.images["Headturn contact sheet"].packed_files
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    assert bpy.ops.headturn.open_folder.poll()
    facts = {"rows": build.progress.result["rows"]}
    (OUT / "facts.json").write_text(json.dumps(facts), encoding="utf-8")

    # A long one, started from a window that is then closed.
    shown().poses_yaw, shown().poses_pitch = (-50, 50, 1), (-40, 40, 1)
    shown().poses_roll = (-30, 30, 10)
    shown().render_resolution = 128
    shown().out = "//long"
    yield 0.3
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.window_new()
    yield 0.5
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        assert bpy.ops.headturn.build("INVOKE_DEFAULT") == {"FINISHED"}
        bpy.ops.wm.window_close()
    yield lambda: build.runs and build.progress.stage == "rendering"
    yield lambda: build.progress.done > 0
    yield from to_the_end()
    shot("14-building")

    # Esc stops playback, and nothing else.
    bpy.ops.screen.animation_play()
    yield 0.5
    yield from key("ESC")
    yield 0.5
    assert not bpy.context.screen.is_animation_playing
    assert build.runs and not build.cancelled

    # Another file: the build goes on, and is shown and ended there.
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_factory_startup_app_template_only=True)
    yield 1.0
    yield from begin()
    done = build.progress.done
    yield lambda: build.progress.done > done
    yield from to_the_end()
    shot("15-another-file")
    yield from press_build()
    yield 0.5
    shot("15-confirm")
    assert not build.cancelled, "it asks first"
    yield from answer("ESC")
    assert build.runs and not build.cancelled
    yield from press_build()
    yield 0.5
    yield from answer("RET")
    yield lambda: not build.runs
    assert build.cancelled and build.exit_code not in (0, 3)
    assert not (OUT / "long" / "manifest.json").exists()
    yield from to_the_end()
    shot("15-cancelled")

    # The file as it was saved: the head as it was, the list, and another head at once.
    session.forget()  # as in another Blender
    yield from reopen()
    assert [*listing().heads] == [("s1p0000", "neutral"), ("s1p0001", "neutral")] and not state.error
    seen = view_pixels(shot("16-reopened"))
    assert np.abs(seen - seen_before).mean() < 0.05, np.abs(seen - seen_before).mean()
    shown().render_lens_mm = 84
    assert not state.error, state.error
    shown().render_lens_mm = 85
    assert bpy.ops.headturn.step_head(what="SUBJECT", by=1) == {"FINISHED"}
    yield lambda: bool(state.error) or keys.placed(shown()).head[0] == "s1p0001"
    assert not state.error, state.error

    # Without the files it came from, the head stands as it was saved, and the panel says what to do.
    shutil.rmtree(folders.lasting("heads"))
    yield from reopen()
    assert "Load Heads" in state.error, state.error
    gone = view_pixels(shot("17-without-its-files"))
    assert np.abs(gone - seen_before).mean() < 0.05, np.abs(gone - seen_before).mean()
    yield from scroll(-60)
    yield from press_load()
    yield lambda: not state.error and idle() and Path(shown().package).is_file()

    # Build goes on where that ended.
    yield from to_the_end()
    yield from press_build()
    yield lambda: build.runs and build.progress.stage == "rendering"
    assert bpy.ops.headturn.cancel() == {"FINISHED"}, "a script is not asked"
    yield lambda: not build.runs

    # A folder that holds something else.
    (OUT / "foreign").mkdir()
    (OUT / "foreign" / "diary.txt").write_text("mine", encoding="utf-8")
    shown().out = "//foreign"
    yield 0.3
    yield from press_build()
    yield lambda: build.exit_code is not None and not build.cancelled
    assert build.exit_code == 1 and "foreign" in build.headline()
    yield from to_the_end()
    shot("16-refused")
    assert "foreign" in build.report and "Headturn report" not in bpy.data.texts
    assert bpy.ops.headturn.report() == {"FINISHED"}
    assert "foreign" in bpy.data.texts["Headturn report"].as_string()


def reopen() -> Iterator[Step]:
    """Open the file anew."""
    bpy.ops.wm.open_mainfile(filepath=str(OUT / "heads.blend"))
    yield 1.0
    yield from begin()
    event("MOUSEMOVE", "NOTHING", 400, 150)  # away from whatever has a tooltip
    yield 1.0


drive(steps)

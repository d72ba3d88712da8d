# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: build, end a build with Esc and with the button, go on, and a folder that is somebody else's."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, building, key, load_heads, press_build, session, shown, to_the_end  # isort: skip
from ui_driver import OUT, Step, area, drive, shot


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    build = building.current
    yield from begin()
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
    shot("13-built")
    facts = {"rows": build.progress.result["rows"]}
    (OUT / "facts.json").write_text(json.dumps(facts), encoding="utf-8")

    # A long one, ended with Esc: what is there stays, and the folder can be continued.
    shown().poses_yaw, shown().poses_pitch = (-50, 50, 1), (-40, 40, 1)
    shown().poses_roll = (-30, 30, 10)
    shown().render_resolution = 128
    shown().out = "//long"
    yield 0.3
    yield from press_build()
    yield lambda: build.runs and build.progress.stage == "rendering"
    yield lambda: build.progress.done > 0
    yield from to_the_end()
    shot("14-building")
    yield from key("ESC")
    yield lambda: not build.runs
    assert build.cancelled and build.exit_code not in (0, 3)
    yield from to_the_end()
    shot("15-cancelled")

    # Build goes on where that ended; this time the Cancel button, in the same place.
    yield from press_build()
    yield lambda: build.runs and build.progress.stage == "rendering"
    yield from to_the_end()
    yield from press_build()
    yield lambda: not build.runs
    assert build.cancelled and not (OUT / "long" / "manifest.json").exists()

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
    assert "foreign" in bpy.data.texts["Headturn report"].as_string()


drive(steps)

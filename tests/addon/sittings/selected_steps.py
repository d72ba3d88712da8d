# SPDX-License-Identifier: GPL-3.0-or-later
"""Use Selected, with the mouse: the head of a user's scene turns, is built, and stands as it stood.

To be imported before ui_driver, as ui_steps is.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ui_steps import building, idle, key, state  # isort: skip
from my_scene_steps import HEAD, open_my_panel, open_my_scene, press, select_my_head, tiny, turntable
from ui_driver import EXTENSION, OUT, Step, drag, region, shot, view_pixels, widgets
from whole_file import differences, whole_file

USE, _SCENE_CAMERA, BUILD, LET_GO = range(4)
"""Buttons of the panel, from the top."""


def use_selected(package: Path) -> Iterator[Step]:
    """From opening the scene to letting go."""
    yield from open_my_scene(package)
    yield from select_my_head()
    tiny()
    before, stood = whole_file(), placed()
    yield from open_my_panel()
    still = view_pixels(shot("30-my-scene"))
    buttons = yield from widgets("buttons")
    yield from press(buttons[USE])
    yield lambda: state.error != "" or turntable() is not None
    assert not state.error, state.error
    yield idle
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (1, 3)

    # Dragging in the timeline turns it: what hangs on the head goes along, and the plinth stays.
    line = region("WINDOW", "DOPESHEET_EDITOR")
    y = line.y + line.height - 10
    seen = {}
    yield from drag(line.x + line.width // 2, y, line.x + 5, y)
    for frame in (1, 3):
        scene.frame_set(frame)
        yield 0.3
        seen[frame] = view_pixels(shot(f"31-frame-{frame}"))
        assert np.abs(seen[frame] - still).mean() > 0.002
    assert np.abs(placed() - stood).max() > 0.1
    assert np.abs(seen[1] - seen[3]).mean() > 0.002

    buttons = yield from widgets("buttons")  # those that can be pressed now
    yield from press(buttons[BUILD])
    yield lambda: building.current.exit_code is not None
    assert building.current.exit_code == 0, building.current.headline()
    rows = building.current.progress.result["rows"]
    (OUT / "mine.json").write_text(json.dumps({"rows": rows}), encoding="utf-8")
    yield 0.5
    shot("32-built")
    assert turntable() is not None and (scene.frame_start, scene.frame_end) == (1, 3)

    yield from press(buttons[LET_GO])
    yield lambda: turntable() is None
    same(before, stood)
    # And with undo: letting go is one step, and so are the frame and using it.
    yield from key("Z", ctrl=True)
    yield lambda: turntable() is not None
    for _ in range(2):
        yield from key("Z", ctrl=True)
    yield lambda: turntable() is None
    same(before, stood)


def as_the_host_sees_blender() -> None:
    """Have the host find this Blender, which may live in a file system of its own; see real_blender.sh."""
    host = import_module(f"{EXTENSION}.core.host")
    told = host.host_command

    def host_command(found: Any, facts: Any, arguments: list[str], _: str, saved_by: Any = None) -> list[str]:
        command: list[str] = told(found, facts, arguments, os.environ["HEADTURN_TEST_BLENDER"], saved_by)
        return command

    host.host_command = host_command


def placed() -> np.ndarray:
    """Where the head stands."""
    return np.array(bpy.data.objects[HEAD].matrix_world)


def same(before: dict, stood: np.ndarray) -> None:
    """The file is as it was, property by property."""
    left = differences(before, whole_file())
    assert not left, "\n".join(left[:20])
    assert np.abs(placed() - stood).max() < 1e-6

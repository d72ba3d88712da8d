# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting for `make screenshots`: the pictures of docs/blender.md, in both of Blender's themes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, building, fold, idle, key, keys, listing, load_heads, look  # isort: skip
from ui_steps import shown, state, to_the_end  # isort: skip
from my_scene_steps import open_my_panel, open_my_scene, press, select_my_head, turntable
from selected_steps import USE, as_the_host_sees_blender
from ui_driver import EXTENSION, Step, click, drive, event, scroll, shot, widgets

THEMES = {"dark": "Blender_Dark.xml", "light": "Blender_Light.xml"}


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    yield from begin()
    as_the_host_sees_blender()
    yield from load_heads(2)
    package = Path(shown().package)
    kept = import_module(f"{EXTENSION}.pictures").kept
    key_of, source = import_module(f"{EXTENSION}.gallery").key_of, keys.placed(shown()).source
    yield lambda: all(kept(key_of(source, head)) for head in listing().heads)
    bpy.ops.headturn.look()
    yield from landmarks()
    yield from heads()
    yield from timeline()
    yield from looks()
    yield from build()
    yield from selected(package)


def taken(name: str) -> Iterator[Step]:
    """The picture of this name in every theme, with the mouse out of the way."""
    event("MOUSEMOVE", "NOTHING", 640, 8)
    for theme in ("light", "dark"):
        wear(theme)
        yield 1.0
        shot(f"{theme}_{name}")


def wear(theme: str) -> None:
    """Have one of the themes that come with Blender."""
    files = (Path(folder) / THEMES[theme] for folder in bpy.utils.preset_paths("interface_theme"))
    file = next(file for file in files if file.exists())
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="USERPREF_MT_interface_theme_presets")


def landmarks() -> Iterator[Step]:
    """A pose with its landmarks, and the rings."""
    shown().yaw, shown().pitch, shown().roll = 20, 5, 0
    shown().show_landmarks = True
    yield lambda: keys.landmarks(shown()) is not None
    yield idle
    yield from scroll(4)  # to what was found
    yield from taken("landmarks")
    yield from scroll(-60)
    shown().show_landmarks = False


def heads() -> Iterator[Step]:
    """The heads of the source, in a menu that stays open as long as nobody goes elsewhere."""
    load, *_ = yield from widgets("buttons")
    yield from click(load.left + 28, load.bottom - 73)
    yield 1.0
    shot("dark_heads")
    yield from key("ESC")


def timeline() -> Iterator[Step]:
    """A pose of the grid."""
    shown().on_timeline = True
    bpy.context.scene.frame_set(160)
    yield 0.5
    yield from taken("timeline")
    shown().on_timeline = False


def looks() -> Iterator[Step]:
    """What seed 7 draws."""
    shown().yaw, shown().pitch, shown().roll = 20, -5, 0
    yield from fold("HeadsPanel", "PosePanel", "PosesPanel", "LookPanel", "BuildPanel")
    shown().look_seed = 7
    yield lambda: look() is not None and look().seed == 7
    yield idle
    yield from taken("looks")


def build() -> Iterator[Step]:
    """A build under way."""
    bpy.ops.headturn.reset_pose()
    shown().poses_yaw, shown().poses_pitch, shown().poses_roll = (-50, 50, 1), (-40, 40, 1), (-30, 30, 10)
    shown().render_resolution, shown().workers, shown().out = 128, 1, "//dataset"
    yield from fold("SelectionPanel", "LookPanel", "LooksPanel", "OutputPanel")
    yield from to_the_end()
    assert bpy.ops.headturn.build("INVOKE_DEFAULT") in ({"RUNNING_MODAL"}, {"FINISHED"})
    yield lambda: building.current.progress.done > 100
    yield from scroll(60)
    yield from taken("build")
    building.current.cancel()
    yield lambda: not building.current.runs


def selected(package: Path) -> Iterator[Step]:
    """The head of a user's scene at a pose of the grid."""
    yield from fold("HeadsPanel", "LookPanel", "LooksPanel", "OutputPanel")
    yield from open_my_scene(package)
    yield from select_my_head()
    shown().out = "//../ada"
    yield from open_my_panel()
    buttons = yield from widgets("buttons")
    yield from press(buttons[USE])
    yield lambda: state.error != "" or turntable() is not None
    assert not state.error, state.error
    bpy.context.scene.frame_set(405)
    yield from taken("selected")


drive(steps)

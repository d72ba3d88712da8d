# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: R and the rings, presets, a file that is dropped, menus, a German interface, a larger one.

The head is a file of the test's: nobody waits for the host.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, key, shown  # isort: skip
from interface_steps import at_twice_the_scale, in_german
from turning_steps import (
    keyframes_of_what_is_shown,
    pose,
    press,
    r_in_my_scene,
    r_turns_the_head,
    rings_turn_the_head,
)
from ui_driver import EXTENSION, OUT, Step, area, drive, event, region, shot, strike

registration = import_module(f"{EXTENSION}.registration")
studio, found = import_module(f"{EXTENSION}.studio"), import_module(f"{EXTENSION}.core.found")
INSIDE = {"step_head", "drop_head", "drop_folder", "pose_preset", "look_preset", "copy"}
"""Operators that are parts of others, with what these tell them."""


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    yield from begin()
    yield from r_in_my_scene()
    yield from fields_have_units()
    mine = bpy.context.scene.name
    scene = studio.studio_scene(bpy.context.scene)
    head = os.environ["HEADTURN_TEST_HEAD"]
    studio.show_package(scene, Path(head), 120.0, found.Placed(("a", "neutral"), "x", 9).text())
    bpy.ops.ed.undo_push(message="Show")
    yield 0.5
    yield from r_turns_the_head()
    yield from rings_turn_the_head()
    yield from keyframes_of_what_is_shown()
    yield from a_head_is_dropped(bpy.data.scenes[mine])
    yield from presets_are_kept()
    yield from everything_is_in_the_menus()
    the_key_is_in_the_preferences()
    yield from in_german()
    yield from at_twice_the_scale()


def fields_have_units() -> Iterator[Step]:
    """What is typed are degrees and millimetres; what was not typed keeps its digits."""
    rna = shown().bl_rna.properties
    assert (rna["render_lens_mm"].unit, rna["yaw_angle"].unit, rna["poses_yaw_angle"].unit) == (
        *("CAMERA", "ROTATION", "ROTATION"),
    )
    assert rna["render_resolution"].subtype == "PIXEL"
    shown().poses_yaw = (-100 / 3, 100 / 3, 100 / 3)
    shown().poses_yaw_angle = (math.radians(-20), *shown().poses_yaw_angle[1:])
    assert tuple(shown().poses_yaw) == (-20, *shown().poses_yaw[1:])
    assert abs(shown().poses_yaw[1] - 100 / 3) < 2e-6
    shown().property_unset("poses_yaw")
    yield 0.1


def a_head_is_dropped(mine: bpy.types.Scene) -> Iterator[Step]:
    """Where our tab is open; the host then looks for heads there."""
    dropping, heads = import_module(f"{EXTENSION}.dropping"), import_module(f"{EXTENSION}.heads")
    asked: list[str] = []
    listed, heads.list_heads = (
        heads.list_heads,
        lambda scene: asked.append(source_of(scene)),
    )
    files = {"directory": str(OUT), "files": [{"name": "anna.vrm"}]}
    (OUT / "anna.vrm").touch()
    with bpy.context.temp_override(area=area(), region=region("WINDOW")):
        assert dropping.HeadHandler.poll_drop(bpy.context)
        # Two of ours read it: Blender asks which.
        assert bpy.ops.wm.drop_import_file("INVOKE_DEFAULT", **files) == {"INTERFACE"}
    yield 0.3
    shot("43-dropped")
    yield from key("ESC")
    assert bpy.ops.headturn.drop_head(filepath=str(OUT / "anna.vrm"), **files) == {"FINISHED"}
    assert bpy.ops.headturn.drop_folder(filepath=str(OUT / "anna.vrm"), **files) == {"FINISHED"}
    assert asked == [str(OUT / "anna.vrm"), str(OUT)] and shown().heads_source == "FOLDER"
    two = {"directory": str(OUT), "files": [{"name": "anna.vrm"}, {"name": "bert.vrm"}]}
    assert bpy.ops.headturn.drop_head(filepath=str(OUT / "anna.vrm"), **two) == {"CANCELLED"}
    # In a scene of the user's, with another tab: Blender's own importers alone.
    scene, bpy.context.window.scene = bpy.context.scene, mine
    region("UI").active_panel_category = "Tool"
    with bpy.context.temp_override(area=area(), region=region("WINDOW")):
        assert not dropping.HeadHandler.poll_drop(bpy.context)
    region("UI").active_panel_category = "Headturn"
    bpy.context.window.scene = scene
    assert bpy.ops.headturn.look() == {"FINISHED"}
    heads.list_heads = listed
    shown().heads_source = "parametric"
    yield 0.2


def source_of(scene: bpy.types.Scene) -> str:
    """Where its heads are to be."""
    return str(scene.headturn.heads_source_folder)


def presets_are_kept() -> Iterator[Step]:
    """A pose and a look, by Blender's own presets."""
    studio.set_pose(shown(), (33, -4.5, 6))
    assert bpy.ops.headturn.pose_preset(name="Over the shoulder") == {"FINISHED"}
    shown().render_lens_mm, shown().render_background = 135, (0.1, 0.2, 0.3)
    shown().draws = "ambient=uniform:0,1"
    shown().render_light_yaw_deg, shown().render_samples_unset = -60, False
    assert bpy.ops.headturn.look_preset(name="Portrait") == {"FINISHED"}
    was = look()
    bpy.ops.headturn.reset_pose()
    for name in was:
        shown().property_unset(name)
    assert look() != was
    for kind, menu in (("poses", "HEADTURN_MT_pose_presets"), ("looks", "HEADTURN_MT_look_presets")):
        folders = bpy.utils.preset_paths(f"headturn/{kind}")
        [file] = [file for folder in folders for file in Path(folder).glob("*.py")]
        assert bpy.ops.script.execute_preset(filepath=str(file), menu_idname=menu) == {"FINISHED"}
    assert pose() == (33, -4.5, 6) and look() == was
    assert bpy.context.scene.camera.data.lens == 135, "the view follows"
    assert getattr(bpy.types, menu).bl_label == "Portrait"
    yield 0.3
    shot("44-presets")
    assert bpy.ops.headturn.look_preset(name="Portrait", remove_name=True) == {"FINISHED"}
    assert not [*Path(folders[0]).glob("*.py")]
    for name in was:
        shown().property_unset(name)


def look() -> dict[str, object]:
    """Every property of the look."""
    names = [name.rpartition(".")[2] for name in import_module(f"{EXTENSION}.presets")._looks()]
    values = {name: getattr(shown(), name) for name in names}
    return {name: tuple(value) if hasattr(value, "__len__") else value for name, value in values.items()}


def everything_is_in_the_menus() -> Iterator[Step]:
    """F3 looks through Blender's menus: each operator of ours that is no part of another is in ours."""
    assert pose() != (0, 0, 0)
    event("MOUSEMOVE", "NOTHING", 300, 300)
    yield 0.1
    yield from press("F3", 300, 300)
    yield 0.5
    yield from strike("pose zero", 300, 300)
    yield 0.5
    shot("44-f3")
    yield from press("RET", 300, 300)
    yield lambda: pose() == (0, 0, 0)
    ours = {name for name in dir(bpy.ops.headturn) if not name.startswith("_")}
    seen = {cls.bl_idname.removeprefix("headturn.") for cls in registration.operators()}
    assert ours - seen == INSIDE, ours - seen
    drawn = [one.__name__ for one in bpy.types.TOPBAR_MT_render._dyn_ui_initialize()]
    assert "_in_render" in drawn and "_in_add" in [
        one.__name__ for one in bpy.types.VIEW3D_MT_add._dyn_ui_initialize()
    ]


def the_key_is_in_the_preferences() -> None:
    """And there it can be changed."""
    keymap = bpy.context.window_manager.keyconfigs.user.keymaps["Object Mode"]
    [item] = [item for item in keymap.keymap_items if item.idname == "headturn.turn"]
    assert (item.type, item.value, item.is_user_defined) == ("R", "PRESS", False)


drive(steps)

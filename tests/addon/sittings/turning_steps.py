# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps that turn the head by keys, rings and keyframes. To be imported before ui_driver, as ui_steps is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import import_module

import bpy

from ui_steps import key, shown  # isort: skip
from ui_driver import EXTENSION, Step, area, drag, event, region, shot, strike, type_value, widgets

studio, turn = import_module(f"{EXTENSION}.studio"), import_module(f"{EXTENSION}.turn")


def pose() -> tuple[float, ...]:
    """As it is said."""
    return tuple(round(getattr(shown(), name), 4) for name in ("yaw", "pitch", "roll"))


def middle() -> tuple[int, int]:
    """Where the head's pivot is, in pixels of the window."""
    view = region("WINDOW")
    with bpy.context.temp_override(area=area(), region=view, region_data=area().spaces.active.region_3d):
        place, radius = turn._on_screen(bpy.context)
    return view.x + round(place[0]), view.y + round(place[1]), radius


def press(name: str, x: int, y: int, **more: object) -> Iterator[Step]:
    """Press and release a key, with the mouse here."""
    event(name, "PRESS", x, y, **more)
    event(name, "RELEASE", x, y, **more)
    yield 0.1


def r_in_my_scene() -> Iterator[Step]:
    """R is Blender's: it turns what is selected."""
    cube = bpy.data.objects["Cube"]
    assert not bpy.ops.headturn.turn.poll() and cube.select_get()
    yield from key("R")
    yield from strike("z90", 400, 300)
    yield from press("RET", 400, 300)
    yield lambda: abs(cube.rotation_euler.z) > 1
    assert math.isclose(abs(cube.rotation_euler.z), math.pi / 2, abs_tol=1e-5), cube.rotation_euler
    yield from key("Z", ctrl=True)


def r_turns_the_head() -> Iterator[Step]:
    """R, an axis, digits, the mouse, the grid, Esc, undo."""
    x, y, radius = middle()
    x, y, radius = round(x), round(y), round(radius)
    started = pose()
    yield from key("R")
    yield from strike("z25", x, y)
    assert pose() == (25, 0, 0), pose()
    yield from press("ESC", x, y)
    assert pose() == started
    for text, to in (("z25", (25, 0, 0)), ("x-12.5", (25, -12.5, 0)), ("y7", (25, -12.5, 7))):
        yield from key("R")
        yield from strike(text, x, y)
        yield from press("RET", x, y)
        assert pose() == to, (text, pose())
    yield from key("Z", ctrl=True)
    yield lambda: pose() == (25, -12.5, 0)
    # By the mouse: R alone turns about the axis that looks at the viewer, and rests at whole degrees.
    studio.set_pose(shown(), (0, 0, 0))
    event("MOUSEMOVE", "NOTHING", x + 200, y)
    yield 0.1
    yield from press("R", x + 200, y)
    for degrees in (5, 10, 15, 20, 25, 30):
        way = math.radians(degrees)
        event("MOUSEMOVE", "NOTHING", x + round(200 * math.cos(way)), y - round(200 * math.sin(way)))
        yield 0.05
    shot("40-r")
    assert pose() == (0, 0, 30), pose()
    event("MOUSEMOVE", "NOTHING", x + round(200 * math.cos(0.6)), y - round(200 * math.sin(0.6)), ctrl=True)
    yield 0.1
    assert pose() == (0, 0, 30), pose()  # 34 degrees, kept to the grid's tens
    yield from press("LEFTMOUSE", x + 100, y)
    assert pose()[2] % 1 == 0
    # Something of the user's that is selected is what R turns.
    studio.set_pose(shown(), (0, 0, 0))
    hat = bpy.data.objects.new("hat", None)
    bpy.context.scene.collection.objects.link(hat)
    hat.select_set(True)
    bpy.context.view_layer.objects.active = hat
    yield 0.1
    yield from key("R")
    yield from strike("z9", x, y)
    yield from press("RET", x, y)
    yield lambda: abs(hat.rotation_euler.z) > 0.1
    assert pose() == (0, 0, 0)
    bpy.data.objects.remove(hat)


def rings_turn_the_head() -> Iterator[Step]:
    """Each ring that is dragged writes its angle, in whole degrees, as one step of undo."""
    studio.set_pose(shown(), (0, 0, 0))
    bpy.ops.ed.undo_push(message="Zero")
    shown().show_axes = False
    yield 0.3
    x, y, radius = middle()
    shot("41-rings")
    # Roll faces the viewer; the two others are lines, which the mouse takes along.
    half = radius * math.sqrt(0.5)
    yield from drag(round(x + half), round(y + half), x + round(radius), y)
    assert pose() == (0, 0, 45), pose()
    yield from key("Z", ctrl=True)
    yield lambda: pose() == (0, 0, 0)
    way = round(math.radians(20) * radius)
    yield from drag(round(x + radius * 0.5), y, round(x + radius * 0.5) - way, y)
    assert pose() == (20, 0, 0), pose()
    studio.set_pose(shown(), (0, 0, 0))
    yield 0.3
    yield from drag(x, round(y + radius * 0.5), x, round(y + radius * 0.5) - way)
    assert pose() == (0, -20, 0), pose()
    shot("42-pitched")
    shown().show_rings = False
    yield 0.3
    yield from drag(x, round(y + radius * 0.5), x, round(y + radius * 0.5) + way)
    assert pose() == (0, -20, 0), "there is no ring"
    shown().show_rings = shown().show_axes = True
    studio.set_pose(shown(), (0, 0, 0))


def keyframes_of_what_is_shown() -> Iterator[Step]:
    """Angles may be keyframed where they are shown, too."""
    scene = bpy.context.scene
    for frame, yaw in ((1, 0.0), (11, 40.0)):
        shown().yaw = yaw
        scene.keyframe_insert("headturn.yaw_angle", frame=frame)
    for frame in (1, 6, 11, 6):
        scene.frame_set(frame)
        yield 0.1
        head = math.degrees(math.atan2(shown().head.matrix_world[1][0], shown().head.matrix_world[0][0]))
        assert abs(abs(head) - shown().yaw) < 1e-3, (frame, shown().yaw, head)
    assert 10 < shown().yaw < 30
    action = scene.animation_data.action
    scene.animation_data_clear()
    bpy.data.actions.remove(action)
    scene.frame_set(1)
    # Typed in the field.
    yaw, *_ = yield from widgets("sliders")
    yield from type_value(*yaw.middle, "-12.5")
    assert pose()[0] == -12.5 and shown().yaw == -12.5

# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of addon.py that runs in Blender's window. argv after --: plain or slider, head, out, count."""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np

KIND, PACKAGE, OUT, COUNT = (kind(v) for kind, v in zip((str, str, str, int), sys.argv[-4:], strict=True))
WARM_UP = 5
drawn: list[None] = []
result: dict[str, float] = {}


def redraws(name: str, change: Callable[[int], None]) -> Iterator[None]:
    """From a change to the picture on the screen; Blender's own loop decides what is drawn anew."""
    times = []
    for k in range(COUNT + WARM_UP):
        drawn.clear()
        start = time.perf_counter()
        change(k)
        while not drawn:
            yield
        yield
        times.append(time.perf_counter() - start)
    result[name] = milliseconds(times[WARM_UP:])


def milliseconds(times: list[float]) -> float:
    """The median."""
    return round(1000 * statistics.median(times), 2)


def view() -> bpy.types.Area:
    """The 3D view, with its sidebar."""
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    area.spaces.active.show_region_ui = True
    return area


def show_tab(area: bpy.types.Area, name: str) -> Iterator[None]:
    """Open a tab of the sidebar."""
    for _ in range(5):
        yield
    next(r for r in area.regions if r.type == "UI").active_panel_category = name


def plain() -> Iterator[None]:
    """What anyone would do by hand: the same mesh, seen from the same distance, turned."""
    area, arrays, scene = view(), np.load(PACKAGE), bpy.context.scene
    for other in list(scene.objects):
        bpy.data.objects.remove(other)
    mesh = bpy.data.meshes.new("plain")
    mesh.from_pydata(arrays["vertices"] / 1000, [], arrays["triangles"])
    lens = bpy.data.cameras.new("camera")
    thing, camera = bpy.data.objects.new("plain", mesh), bpy.data.objects.new("camera", lens)
    for other in (thing, camera):
        scene.collection.objects.link(other)
    scene.camera, lens.lens, camera.location = camera, 85, (0, 0, 0.62)
    scene.render.resolution_x = scene.render.resolution_y = 256
    space = area.spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.shading.light, space.shading.color_type = "FLAT", "TEXTURE"

    def turn(k: int) -> None:
        thing.rotation_euler[1] = 0.7 * (-1) ** k

    yield from show_tab(area, "View")
    yield from redraws("without the extension, a plain object turned, sidebar open", turn)
    yield from redraws("without the extension, nothing turned, drawn again", lambda k: area.tag_redraw())
    space.show_region_ui = False
    yield from redraws("without the extension, a plain object turned, no sidebar", turn)


def slider() -> Iterator[None]:
    """The extension's."""
    from bl_ext.user_default.headturn import studio

    area, scene = view(), studio.studio_scene(bpy.context.scene)
    studio.show_package(scene, Path(PACKAGE), 120.0)
    shown, turns, updates = scene.headturn, [], []
    area.spaces.active.show_region_ui = True

    def slide(k: int) -> None:
        shown.yaw = 40 * (-1) ** k

    yield from show_tab(area, "Headturn")
    for k in range(COUNT):
        start = time.perf_counter()
        slide(k)
        turns.append(time.perf_counter() - start)
        bpy.context.view_layer.update()
        updates.append(time.perf_counter() - start)
    result["vertices"] = len(shown.head.data.vertices)
    result["slider moved, head turned"] = milliseconds(turns)
    result["slider moved, head turned, evaluated by Blender"] = milliseconds(updates)
    yield from redraws("slider to screen, our tab open", slide)
    yield from redraws("our tab open, nothing turned, drawn again", lambda k: area.tag_redraw())
    shown.show_axes = False
    yield from redraws("slider to screen, our tab open, no axes", slide)
    area.spaces.active.show_region_ui = False
    yield from redraws("slider to screen, no axes, no sidebar", slide)


def main() -> None:
    """Write what was measured to OUT and end Blender."""
    steps = {"plain": plain, "slider": slider}[KIND]()

    def tick() -> float | None:
        try:
            next(steps)
            return 0.0
        except StopIteration:
            Path(OUT).write_text(json.dumps(result), encoding="utf-8")
        except BaseException:
            traceback.print_exc()
            sys.stdout.flush()
            os._exit(9)
        os._exit(0)

    bpy.types.SpaceView3D.draw_handler_add(lambda: drawn.append(None), (), "WINDOW", "POST_PIXEL")
    bpy.app.timers.register(tick, first_interval=1.0)


main()

# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: load heads, turn one by slider and by number, undo, scrub the timeline, switch us off and on;
then the same with a head in a scene of the user's own."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import axis_pixels, begin, key, listing, load_heads, shown  # isort: skip
from selected_steps import as_the_host_sees_blender, use_selected
from ui_driver import EXTENSION, OUT, Step, area, drag, drive, region, shot, type_value, view_pixels, widgets


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    own = bpy.context.scene
    yield from begin()
    as_the_host_sees_blender()
    viewed = view_of_mine()
    yield from load_heads(2)
    package = Path(shown().package)
    assert bpy.context.scene != own, "the user's own scene must stay as it was"
    assert [o.name for o in own.objects] == ["Cube", "Light", "Camera"] or len(own.objects) == 3
    assert shown().subject and shown().expression == "neutral"
    assert len(listing().subjects()) == 2
    before = view_pixels(shot("05-loaded"))

    # A slider turns the head in the pixels and rebuilds nothing.
    mesh, material = shown().head.data.as_pointer(), shown().head.data.materials[0].as_pointer()
    yaw, pitch, *_ = yield from widgets("sliders")
    x, y = yaw.middle
    yield from drag(x, y, x + 60, y)
    assert shown().yaw > 5, shown().yaw
    after = view_pixels(shot("06-slider"))
    changed = float((np.abs(after - before).max(axis=2) > 0.1).mean())
    assert changed > 0.05, f"{changed:.1%} of the view changed"
    assert (shown().head.data.as_pointer(), shown().head.data.materials[0].as_pointer()) == (mesh, material)
    (OUT / "facts.json").write_text(json.dumps({"changed": changed}), encoding="utf-8")

    # A typed value, and undo.
    yield from type_value(*pitch.middle, "-12.5")
    assert shown().pitch == -12.5, shown().pitch
    turned = np.array(shown().head.matrix_world)
    shot("07-typed")
    yield from key("Z", ctrl=True)
    yield lambda: shown().pitch == 0.0
    assert shown().yaw > 5, shown().yaw
    assert np.abs(np.array(shown().head.matrix_world) - turned).max() > 0.05
    yield from key("Z", ctrl=True, shift=True)
    yield lambda: shown().pitch == -12.5
    assert np.abs(np.array(shown().head.matrix_world) - turned).max() < 1e-6

    # Undo took the stage away; an edit of the look goes on with another one.
    shown().render_lens_mm = 50
    assert bpy.context.scene.camera.data.lens == 50
    yield 0.3
    shown().render_lens_mm = 85

    # Snapping.
    shown().snap = True
    shown().pitch = 13.0
    assert (shown().pitch, shown().yaw % 10) == (10.0, 0.0)
    shown().snap = False

    # The grid on the timeline: dragging in the timeline scrubs.
    shown().on_timeline = True
    yield 0.3
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (1, 693)
    assert (shown().yaw, shown().pitch, shown().roll) == (-50, -40, -30)
    line = region("WINDOW", "DOPESHEET_EDITOR")
    top = line.y + line.height - 10
    yield from drag(line.x + line.width // 2, top, line.x + line.width // 4, top)
    assert scene.frame_current > 1
    index = scene.frame_current - 1
    expected = (-50 + 10 * (index // 63), -40 + 10 * (index // 7 % 9), -30 + 10 * (index % 7))
    assert (shown().yaw, shown().pitch, shown().roll) == expected, (scene.frame_current, expected)
    shot("08-timeline")
    shown().on_timeline = False

    # Back to the user's scene, whose 3D view is as it was; also where it is chosen in Blender's own menu.
    studio, was = scene, (shown().yaw, shown().pitch, shown().roll)
    assert bpy.ops.headturn.leave() == {"FINISHED"}
    yield 0.3
    assert bpy.context.scene == own and view_of_mine() == viewed, (viewed, view_of_mine())
    shot("16-back")
    for there in (studio, own, studio):
        bpy.context.window.scene = there
        yield 0.3
        if there == own:
            assert view_of_mine() == viewed, (viewed, view_of_mine())
        else:
            assert bpy.ops.headturn.look() == {"FINISHED"}
            yield 0.3
            assert view_of_mine() != viewed
    assert (shown().yaw, shown().pitch, shown().roll) == was

    # Off and on again: the axes go and come back.
    import addon_utils

    shown().yaw, shown().pitch, shown().roll = 20, 5, 0
    yield 0.3
    seen = axis_pixels(shot("17-before"))
    addon_utils.disable(EXTENSION)
    assert not hasattr(bpy.types.Scene, "headturn")
    yield 0.3
    gone = axis_pixels(shot("18-disabled"))
    addon_utils.enable(EXTENSION)
    yield 0.3
    yield 0.3  # a redraw may take longer than that, and ours comes after it
    back = axis_pixels(shot("19-enabled-again"))
    assert seen > 150 and gone < 10 and back > 0.9 * seen, (seen, gone, back)

    yield from use_selected(package)


def view_of_mine() -> tuple[object, ...]:
    """How the 3D view looks, and from where."""
    space = area().spaces.active
    seen, shading = space.region_3d, space.shading
    place = [round(x, 4) for x in (*seen.view_rotation, *seen.view_location, seen.view_distance)]
    return (
        seen.view_perspective,
        place,
        shading.type,
        shading.light,
        shading.color_type,
        shading.background_type,
    )


drive(steps)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the scene as it stands."""

from __future__ import annotations

import bpy

_ASIDE = "aside"
"""A scene with nothing in it."""


def render_still() -> None:
    """Render the scene into the file that its settings name.

    The operator is called from an empty scene: before and after, Blender's Python has all be evaluated anew
    in the one it is called from, which no picture needs. That is 1.7 ms of a picture of 50 objects. The frame
    that is rendered is that of the scene it is called from, too.
    """
    scene = bpy.context.scene
    aside = bpy.data.scenes.get(_ASIDE) or bpy.data.scenes.new(_ASIDE)
    frame = scene.frame_current, scene.frame_subframe
    if frame != (aside.frame_current, aside.frame_subframe):
        aside.frame_set(frame[0], subframe=frame[1])
    with bpy.context.temp_override(scene=aside, view_layer=aside.view_layers[0]):
        bpy.ops.render.render(write_still=True, scene=scene.name)

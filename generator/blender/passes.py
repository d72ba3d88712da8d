# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of what is seen, pixel by pixel: Blender's render passes as one multilayer OpenEXR."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy

from generator.blender import compat
from generator.plan.passes import OBJECT_INDEX
from generator.registries import PASSES

HEAD_INDEX, WORN_INDEX = 1, 2

CENTRE_ONLY = 0.01
"""Blender's narrowest pixel filter, in pixels: the one sample lies at the pixel's centre."""


def render_passes(
    path: Path, head: bpy.types.Object, worn: Sequence[bpy.types.Object], passes: Sequence[str]
) -> None:
    """Render passes of the scene as it stands into path, as Blender names them.

    Where there is no surface object_index is 0, so it is always among them. Raises UsageError
    for a pass that is none of :data:`generator.registries.PASSES`.
    """
    scene = bpy.context.scene
    render = scene.render
    head.pass_index = HEAD_INDEX
    for thing in worn:
        thing.pass_index = WORN_INDEX
    layer = scene.view_layers[0]
    switches = {PASSES.get(name).switch for name in PASSES}
    wanted = {OBJECT_INDEX.switch, *(PASSES.get(name).switch for name in passes)}
    with _restored(scene.cycles, "samples", "pixel_filter_type", "filter_width"):
        for switch in switches:
            setattr(layer, switch, switch in wanted)
        scene.cycles.samples = 1
        scene.cycles.pixel_filter_type = "BOX"
        scene.cycles.filter_width = CENTRE_ONLY
        compat.use_multilayer(render.image_settings)
        render.use_border = render.film_transparent = False
        render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
    for switch in switches:
        setattr(layer, switch, False)


@contextmanager
def _restored(owner: bpy.types.bpy_struct, *names: str) -> Iterator[None]:
    before = {name: getattr(owner, name) for name in names}
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(owner, name, value)

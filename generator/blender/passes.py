# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of what is seen, pixel by pixel: Blender's render passes as one multilayer OpenEXR."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy

from generator.blender import compat
from generator.blender.label_group import tell_apart
from generator.blender.materials import ALBEDO, LABELLED, LIT, show
from generator.blender.stage import Stage
from generator.blender.still import render_still
from generator.labels import LABELS
from generator.plan.passes import ALBEDO as ALBEDO_PASS
from generator.plan.passes import LABELS_A_PICTURE, OBJECT_INDEX, PAINTED, PAINTED_SAMPLES, SEGMENTATION
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
    head.pass_index = HEAD_INDEX
    for thing in worn:
        thing.pass_index = WORN_INDEX
    render_passes_alone(path, passes)


def render_passes_alone(path: Path, passes: Sequence[str]) -> None:
    """:func:`render_passes` of objects that have their index."""
    scene = bpy.context.scene
    render = scene.render
    layer = scene.view_layers[0]
    switches = {PASSES.get(name).switch for name in PASSES} - {PAINTED}
    wanted = {OBJECT_INDEX.switch, *(PASSES.get(name).switch for name in passes)}
    kept = ("samples", "pixel_filter_type", "filter_width", "use_adaptive_sampling", "use_denoising")
    with _restored(scene.cycles, *kept), _restored(render, "film_transparent"):
        for switch in switches:
            setattr(layer, switch, switch in wanted)
        scene.cycles.samples = 1
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.cycles.pixel_filter_type = "BOX"
        scene.cycles.filter_width = CENTRE_ONLY
        compat.use_multilayer(render.image_settings)
        render.use_border = render.film_transparent = False
        render.filepath = str(path)
        render_still()
    for switch in switches:
        setattr(layer, switch, False)


def render_albedo_alone(path: Path) -> None:
    """Render what share of white light the surfaces of a scene send back, as Cycles itself has it, into path.

    Beside it lies the coverage that it is multiplied by, as alpha of the picture. Nothing is kept from
    picture to picture: Cycles would keep the pattern of samples of which there were fewer or more.
    """
    scene = bpy.context.scene
    layer = scene.view_layers[0].cycles
    kept = ("samples", "pixel_filter_type", "filter_width", "use_adaptive_sampling", "use_denoising")
    with (
        _restored(scene.cycles, *kept),
        _restored(scene.render, "film_transparent", "use_persistent_data"),
        _restored(layer, "denoising_store_passes"),
    ):
        scene.render.use_persistent_data = False
        layer.denoising_store_passes = True
        scene.cycles.samples = PAINTED_SAMPLES
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
        compat.use_multilayer(scene.render.image_settings)
        scene.render.film_transparent = True
        scene.render.filepath = str(path)
        render_still()


@contextmanager
def painting(stage: Stage, passes: Sequence[str]) -> Iterator[Iterator[tuple[str, int]]]:
    """Have a stage show its materials' colours, and then one group of their classes after another.

    Yields (pass, group) as long as there is another; what is rendered then is linear, with alpha, the mean
    over each pixel itself and not over its neighbours.
    """
    scene = bpy.context.scene
    render, settings = scene.render, scene.render.image_settings
    compat.use_still_images(settings)
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.exr_codec = "NONE"
    with _restored(scene.cycles, "pixel_filter_type", "filter_width"), _restored(render, "film_transparent"):
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
        render.film_transparent, render.use_border = True, False
        try:
            yield _shown(stage, passes)
        finally:
            _show(stage, LIT)  # or the next picture would be of classes


def _shown(stage: Stage, passes: Sequence[str]) -> Iterator[tuple[str, int]]:
    if ALBEDO_PASS.name in passes:
        _show(stage, ALBEDO)
        yield ALBEDO_PASS.name, 0
    if SEGMENTATION.name in passes:
        _show(stage, LABELLED)
        for group in range(len(LABELS) // LABELS_A_PICTURE):
            tell_apart(group)
            yield SEGMENTATION.name, group


def _show(stage: Stage, what: str) -> None:
    for thing in stage.at_hand:
        for material in thing.data.materials:
            show(material, what)


@contextmanager
def _restored(owner: bpy.types.bpy_struct, *names: str) -> Iterator[None]:
    before = {name: getattr(owner, name) for name in names}
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(owner, name, value)

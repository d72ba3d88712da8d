# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of a head as image files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from generator.blender import compat
from generator.blender.clearing import clear
from generator.blender.crop import Backdrop, Backdrops, Box, Outline, around
from generator.blender.devices import Device
from generator.blender.needs import Needs, is_layered
from generator.blender.passes import painting, render_passes
from generator.blender.stage import Stage
from generator.blender.still import render_still
from generator.heads.mesh import HeadMesh
from generator.heads.package import load_package
from generator.labels import LABELS
from generator.plan.environment_light import EnvironmentLight
from generator.plan.passes import LABELS_A_PICTURE, PAINTED_SAMPLES, SEGMENTATION, painted_file
from generator.plan.settings import Look
from generator.plan.shading import unshaded
from generator.plan.views import View, Views
from generator.plan.wear import Worn


class Images:
    """Renders views of one head.

    Replaces everything in Blender by the head. mesh: frame U, mm, pivot at the origin.
    threads: of Cycles; 0 lets Blender take every core. device: the CPU, where it is not given.
    backdrops: of heads before.
    """

    def __init__(
        self,
        mesh: HeadMesh,
        *,
        threads: int = 0,
        device: Device | None = None,
        backdrops: Backdrops | None = None,
    ) -> None:
        self._mesh, self._threads, self._device = mesh, threads, device or Device()
        self._outline = Outline(mesh.vertices)
        self._worn: dict[str, HeadMesh] = {}
        self._outlines: dict[str, Outline] = {}
        self._stage: Stage | None = None
        self._knows_uv = False
        self._empty: Any = None  # what an image without the head depends on, of the last view
        self._ahead: list[tuple[Look, EnvironmentLight | None, Sequence[Worn]]] = []
        self._alike = 0  # views in a row for which that is the same
        self._backdrops = backdrops or Backdrops()

    def wear(self, packages: Iterable[str]) -> None:
        """Have these things at hand, and no others. Raises OSError or ValueError: one cannot be read."""
        wanted = dict.fromkeys(packages)
        self._worn = {name: self._worn.get(name) or load_package(Path(name)) for name in wanted}
        self._outlines = {
            name: self._outlines.get(name) or Outline(mesh.vertices) for name, mesh in self._worn.items()
        }
        if self._stage is not None:
            self._stage.hang(self._worn)

    def expect(
        self,
        views: Views,
        environments: Sequence[EnvironmentLight | None] = (),
        worn: Sequence[Sequence[Worn]] = (),
    ) -> None:
        """What is rendered next, in order, of what :meth:`wear` brought: it takes less time, and is the
        same."""
        count = len(views)
        looks = (view.look for view in views)
        self._ahead = list(zip(looks, environments or [None] * count, worn or [()] * count, strict=True))
        if self._stage is not None:
            self._stage.expect(self._ahead)

    def render(
        self,
        view: View,
        path: Path,
        environment: EnvironmentLight | None = None,
        worn: Sequence[Worn] = (),
    ) -> None:
        """Render a view into path: .bmp (sRGB) or .exr (linear float32).

        environment: lights it, where there is one. worn: of what :meth:`wear` brought.

        Both are lossless and quick to write; what is kept of an image is encoded by
        the host, without the times and dates that Blender puts into a PNG. Of a
        .bmp only the pixels the head can cover are rendered: the same bytes in less time.
        """
        stage = self._show(view, environment, worn)
        self._knows_uv = False
        empty = (view.camera.width, view.camera.height, view.look.preset, view.look.background)
        self._alike = self._alike + 1 if empty == self._empty else 1
        self._empty = empty
        backdrop = self._backdrops.find(empty) if path.suffix == ".bmp" else None
        # A backdrop costs as much as an image, so one is made for the second.
        if backdrop is None and (path.suffix != ".bmp" or self._alike == 1):
            _render(path)
            return
        if backdrop is None:
            for thing in stage.objects:
                thing.hide_render = True
            _render(path)
            for thing in stage.objects:
                thing.hide_render = False
            backdrop = Backdrop(path)
            self._backdrops.keep(empty, backdrop)
        box = self._box(view, worn)
        if box is not None:
            _render(path, box)
        backdrop.lay(path, box)

    def layered(self, look: Look) -> bool:
        """Is a head of this look rendered over nothing?"""
        return is_layered(look)

    def render_over_nothing(
        self,
        view: View,
        path: Path,
        environment: EnvironmentLight | None = None,
        worn: Sequence[Worn] = (),
    ) -> Box | None:
        """Render the head alone into path, .exr: linear, half floats, multiplied by alpha.

        Returns which pixels path holds: those that it can cover. None if these are none: then it holds all.
        """
        self._show(view, environment, worn)
        self._knows_uv = False
        box = self._box(view, worn)
        _render(path, box, over_nothing=True)
        return box

    def render_passes(self, view: View, path: Path, passes: Sequence[str], worn: Sequence[Worn] = ()) -> None:
        """Render passes of a view; see :mod:`generator.blender.passes`."""
        # Geometry alone: what a path tracer calls the normal is that of its glossy part, too.
        stage = self._show(replace(view, look=unshaded(view.look)), None, worn)
        if "uv" in passes and not self._knows_uv:
            # Persistent data keeps the mesh as pictures need it, which is without its UV map.
            for thing in stage.objects:
                thing.data.update_tag()
            self._knows_uv = True
        render_passes(path, stage.head, stage.objects[1:], passes)

    def render_painted(
        self, views: Views, paths: Sequence[Path], passes: Sequence[str], worn: Sequence[Sequence[Worn]]
    ) -> None:
        """Render painted passes of some views, each beside its path; see :func:`painting`.

        Of classes that nothing in a view has there is no picture. What is shown changes once for all views:
        that costs more than a picture.
        """
        bare = [replace(view, look=Look(samples=PAINTED_SAMPLES)) for view in views]
        stage = self._show(bare[0], None, worn[0])
        labels = [self._labels(things) for things in worn]
        with painting(stage, passes) as shown:
            for name, group in shown:
                there = {*LABELS[LABELS_A_PICTURE * group :][:LABELS_A_PICTURE]}
                for view, path, things, classes in zip(bare, paths, worn, labels, strict=True):
                    if name != SEGMENTATION.name or there & classes:
                        stage.show(view, None, things)
                        stage.see_through_all()
                        target = path.with_name(painted_file(path.stem, name, group))
                        _render_again(target, self._box(view, things))

    def _labels(self, worn: Sequence[Worn]) -> set[str]:
        """The classes that the head and what it wears may have."""
        meshes = [self._mesh, *(self._worn[one.package] for one in worn)]
        materials = [material for mesh in meshes for material in mesh.materials]
        mapped = any(material.label_map for material in materials)
        return {*LABELS} if mapped else {material.label for material in materials}

    def _box(self, view: View, worn: Sequence[Worn]) -> Box | None:
        """The pixels that the head and what it wears can cover."""
        boxes = [self._outline.box(view.pose, view.camera)]
        boxes += [self._outlines[one.package].box(view.pose, view.camera, one.offset_mm) for one in worn]
        return around(boxes)

    def _show(self, view: View, environment: EnvironmentLight | None, worn: Sequence[Worn]) -> Stage:
        has_one = environment is not None
        if self._stage is None or not self._stage.fits(view.look, has_one):
            needs = Needs.of(view.look, has_one)
            if view.look.preset == "fast":
                # The next looks need what this one does not, and those before may come again.
                for look, light, _ in self._ahead:
                    needs |= Needs.of(look, light is not None)
                needs |= self._stage.needs if self._stage is not None else needs
            self._stage = None
            clear()
            self._stage = Stage(bpy.context.scene, self._mesh, view.look, threads=self._threads, needs=needs)
            self._device.use(bpy.context.scene)
            self._stage.hang(self._worn)
            self._stage.expect(self._ahead)
        self._stage.show(view, environment, worn)
        return self._stage


def _render(path: Path, box: Box | None = None, *, over_nothing: bool = False) -> None:
    """Render the scene as it stands into path, or the pixels of a box alone, which path holds then.

    over_nothing: with alpha.
    """
    render = bpy.context.scene.render
    settings = render.image_settings
    compat.use_still_images(settings)
    render.film_transparent = over_nothing
    if over_nothing:
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "16"
        settings.exr_codec = "NONE"
    elif path.suffix == ".exr":
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    elif path.suffix == ".bmp":
        settings.file_format, settings.color_mode = "BMP", "RGB"
    else:
        raise ValueError(f"{path}: images are .bmp or .exr")
    _render_again(path, box, cropped=True)


def _render_again(path: Path, box: Box | None, *, cropped: bool = False) -> None:
    """Render the scene with the settings of an image as they stand, or the pixels of a box alone."""
    render = bpy.context.scene.render
    render.use_border = box is not None
    render.use_crop_to_border = box is not None and cropped
    if box is not None:
        # Blender cuts to whole pixels; a quarter more keeps rounding from losing one.
        left, right = ((edge + 0.25) / render.resolution_x for edge in box[:2])
        bottom, top = ((edge + 0.25) / render.resolution_y for edge in box[2:])
        render.border_min_x, render.border_max_x = left, right
        render.border_min_y, render.border_max_y = bottom, top
    render.filepath = str(path)
    render_still()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of a head in a user's own scene, with its engine, light, world and materials."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from generator.blender import compat
from generator.blender.crop import Box
from generator.blender.devices import Device
from generator.blender.passes import render_albedo_alone, render_passes_alone
from generator.blender.scene_head import SceneHead
from generator.blender.stage import set_lens
from generator.blender.still import render_still
from generator.errors import HeadError
from generator.geometry.camera import Camera
from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.heads.scene import BlendScene, Eye
from generator.plan.environment_light import EnvironmentLight
from generator.plan.passes import ALBEDO, painted_file
from generator.plan.render_settings import PLAIN
from generator.plan.settings import Look
from generator.plan.views import View, Views
from generator.plan.wear import Worn

HEAD_INDEX, OTHER_INDEX = 1, 3


class SceneImages:
    """Renders views of one head in its scene; see :class:`generator.blender.images.Images`.

    Replaces everything in Blender by the scene. scene: of the head in frame U, mm, pivot at the origin.
    threads: of Cycles; 0 lets Blender take every core. device: the CPU, where it is not given.
    """

    def __init__(self, scene: BlendScene, *, threads: int = 0, device: Device | None = None) -> None:
        self._placed = scene
        self._head = SceneHead(Path(scene.file), scene.head_object, scene.shape_key)
        self._scene = self._head.scene
        self._own_samples = self._scene.cycles.samples
        self._lens = bpy.data.cameras.new("Headturn camera")
        self._camera = bpy.data.objects.new("Headturn camera", self._lens)
        self._scene.collection.objects.link(self._camera)
        self._theirs = self._scene.camera.data if scene.camera is not None else None
        self._aspect = self._scene.render.pixel_aspect_x, self._scene.render.pixel_aspect_y
        self._scene.camera = self._camera
        _settle(self._scene, threads)
        # Cycles keeps strands of particles as they stand first, and their rounding would be in all pictures.
        if any(one.particle_systems for one in (*self._head.objects, *self._head.instanced())):
            self._scene.render.use_persistent_data = False
        (device or Device()).use(self._scene)

    def wear(self, packages: Iterable[str]) -> None:
        """A head of a scene wears what it wears there. Raises HeadError for anything else."""
        if [*packages]:
            raise HeadError("a head of a scene is rendered as it stands, and wears nothing else")

    def expect(self, *_: Any) -> None:
        """Nothing is prepared ahead."""

    def render(
        self,
        view: View,
        path: Path,
        environment: EnvironmentLight | None = None,
        worn: Sequence[Worn] = (),
    ) -> None:
        """Render a view into path: .bmp, as the scene's own colour management shows it."""
        self._show(view)
        settings = self._scene.render.image_settings
        compat.use_still_images(settings)
        settings.file_format, settings.color_mode = "BMP", "RGB"
        settings.color_management = "FOLLOW_SCENE"
        self._scene.render.filepath = str(path)
        render_still()

    def layered(self, look: Look) -> bool:
        """Is another backdrop asked for? Light is the scene's own, whatever the preset."""
        return look.backdrop != PLAIN

    def render_over_nothing(self, *_: Any) -> Box | None:
        """Raises HeadError: the scene is what is behind the head."""
        raise HeadError("what is behind the head of a scene is the scene")

    def render_passes(self, view: View, path: Path, passes: Sequence[str], worn: Sequence[Worn] = ()) -> None:
        """Render passes of a view; see :mod:`generator.blender.passes`."""
        ours = {*self._head.objects}
        for one in bpy.data.objects:
            one.pass_index = HEAD_INDEX if one in ours else OTHER_INDEX
        for one in self._head.instanced():
            one.pass_index = HEAD_INDEX
        with self._sharp(view):
            render_passes_alone(path, passes)

    def render_painted(self, views: Views, paths: Sequence[Path], passes: Sequence[str], worn: Any) -> None:
        """Render the albedo of some views, each beside its path.

        Raises HeadError for other passes: a scene's materials do not say what they are.
        """
        if [*passes] != [ALBEDO.name]:
            raise HeadError(f"a scene has no pass {', '.join({*passes} - {ALBEDO.name})}")
        for view, path in zip(views, paths, strict=True):
            with self._sharp(view):
                render_albedo_alone(path.with_name(painted_file(path.stem, ALBEDO.name)))

    @contextmanager
    def _sharp(self, view: View) -> Iterator[None]:
        """Show a view as a pinhole camera sees it."""
        self._show(view)
        lens = self._camera.data
        focused, lens.dof.use_dof = lens.dof.use_dof, False
        try:
            yield
        finally:
            lens.dof.use_dof = focused

    def _show(self, view: View) -> None:
        eye = self._placed.eye(view.camera)
        self._aim(view.camera, eye)
        turn = graphics_rotation(rotation_from_angles(np.array(view.pose, dtype=np.float64)))
        pivot = self._placed.world(np.zeros(3))
        self._head.turn(eye.rotation @ turn @ self._placed.rotation.T, pivot)
        self._scene.cycles.samples = view.look.samples or self._own_samples

    def _aim(self, camera: Camera, eye: Eye) -> None:
        render = self._scene.render
        render.resolution_x, render.resolution_y = camera.width, camera.height
        world = np.eye(4)
        world[:3, :3], world[:3, 3] = eye.rotation, eye.position
        self._camera.matrix_world = Matrix(world.tolist())
        if camera.of_scene:
            self._camera.data = self._theirs
            render.pixel_aspect_x, render.pixel_aspect_y = self._aspect
            return
        self._camera.data = self._lens
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
        set_lens(self._lens, camera, 1 / eye.mm)


def _settle(scene: bpy.types.Scene, threads: int) -> None:
    """What differs from the scene's own settings: what would change from run to run, move what is labelled,
    write other files, or run what is written in the .blend."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_percentage = 100
    render.use_file_extension = False
    render.use_overwrite, render.use_placeholder = True, False
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False  # may move pixels, and write files anywhere
    render.use_border = render.use_multiview = render.use_stamp = render.use_freestyle = False
    render.use_motion_blur = False
    render.dither_intensity = 0.0
    render.threads_mode = "FIXED" if threads else "AUTO"
    if threads:
        render.threads = threads
    scene.timeline_markers.clear()  # they may choose another camera
    cycles.shading_system = False  # no shaders of the file's own
    cycles.use_animated_seed = False
    cycles.time_limit = 0.0
    if not getattr(import_module("_cycles"), "with_openimagedenoise", False):
        cycles.use_denoising = False

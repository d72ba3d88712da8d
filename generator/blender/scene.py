# SPDX-License-Identifier: GPL-3.0-or-later
"""One head before one camera: built once a head, turned once a frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from generator.blender import compat
from generator.blender.crop import Backdrop, Box, Outline
from generator.blender.light import build_light
from generator.blender.materials import UV_MAP, VERTEX_COLORS, build_material, srgb_to_linear
from generator.blender.passes import render_passes
from generator.geometry.camera import SENSOR_MM, Camera
from generator.geometry.rotation import (
    BLENDER_FROM_GRAPHICS,
    blender_rotation,
    rotation_from_angles,
)
from generator.heads.mesh import HeadMesh
from generator.plan.render_settings import RenderSettings

METRES = 1e-3
"""Blender units (metres) in a millimetre."""

QUALITY_BOUNCES = 2


class Stage:
    """The scene in Blender: replaces everything there by one head, its light and its camera.

    Parameters
    ----------
    mesh: frame U, mm, pivot at the origin.
    distance_mm: camera to pivot.
    threads: of Cycles; 0 lets Blender take every core.
    """

    def __init__(
        self, mesh: HeadMesh, settings: RenderSettings, distance_mm: float, *, threads: int = 0
    ) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._head = fill_scene(bpy.context.scene, mesh, settings, distance_mm, threads=threads)
        self._outline = Outline(
            mesh.vertices, Camera(settings.resolution, settings.lens_mm, distance_mm, settings.projection)
        )
        self._backdrop: Backdrop | None = None
        self._knows_uv = False
        self._frames = 0

    def render(self, ypr_deg: Sequence[float], path: Path) -> None:
        """Render the head at (yaw, pitch, roll) degrees into path: .bmp (sRGB) or .exr (linear float32).

        Both are lossless and quick to write; what is kept of a frame is encoded by
        the host, without the times and dates that Blender puts into a PNG. Of a
        .bmp only the pixels the head can cover are rendered: the same bytes in less time.
        """
        turn(self._head, ypr_deg)
        self._knows_uv = False
        self._frames += 1
        # The backdrop costs as much as a frame, so it is made for the second.
        if path.suffix != ".bmp" or self._frames == 1:
            _render(path)
            return
        if self._backdrop is None:
            self._head.hide_render = True
            _render(path)
            self._head.hide_render = False
            self._backdrop = Backdrop(path)
        box = self._outline.box(ypr_deg)
        if box is not None:
            _render(path, box)
        self._backdrop.lay(path, box)

    def render_passes(self, ypr_deg: Sequence[float], path: Path, passes: Sequence[str]) -> None:
        """Render passes at (yaw, pitch, roll) degrees; see :mod:`generator.blender.passes`."""
        turn(self._head, ypr_deg)
        if "uv" in passes and not self._knows_uv:
            # Persistent data keeps the mesh as pictures need it, which is without its UV map.
            self._head.data.update_tag()
            self._knows_uv = True
        render_passes(path, self._head, passes)


def fill_scene(
    scene: bpy.types.Scene, mesh: HeadMesh, settings: RenderSettings, distance_mm: float, *, threads: int = 0
) -> bpy.types.Object:
    """Put a head, its light and its camera into an empty scene, as :class:`Stage` does.

    Returns the head's object, to be turned by :func:`turn`.
    """
    head = _build_head(mesh, settings)
    scene.collection.objects.link(head)
    if settings.preset == "fast":
        # Path tracing meets the mesh so often that a tree of its own, built anew, is the quicker one.
        scene.collection.objects.link(_unseen_twin(head))
    build_light(scene, settings, srgb_to_linear(settings.background))
    _build_camera(scene, settings, distance_mm)
    _set_render(scene, settings, threads)
    return head


def turn(head: bpy.types.Object, ypr_deg: Sequence[float]) -> None:
    """Set the head's rotation to R_B of (yaw, pitch, roll) in degrees."""
    rotation = blender_rotation(rotation_from_angles(np.asarray(ypr_deg, dtype=np.float64)))
    head.matrix_world = Matrix(rotation.tolist()).to_4x4()


def _render(path: Path, box: Box | None = None) -> None:
    """Render the scene as it stands into path, or the pixels of a box alone."""
    render = bpy.context.scene.render
    settings = render.image_settings
    compat.use_still_images(settings)
    if path.suffix == ".exr":
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    elif path.suffix == ".bmp":
        settings.file_format, settings.color_mode = "BMP", "RGB"
    else:
        raise ValueError(f"{path}: frames are .bmp or .exr")
    render.use_border = render.use_crop_to_border = box is not None
    if box is not None:
        # Blender cuts to whole pixels; a quarter more keeps rounding from losing one.
        left, right, bottom, top = ((edge + 0.25) / render.resolution_x for edge in box)
        render.border_min_x, render.border_max_x = left, right
        render.border_min_y, render.border_max_y = bottom, top
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def _unseen_twin(head: bpy.types.Object) -> bpy.types.Object:
    """A second user of the head's mesh that no ray can hit.

    Cycles bakes the transform of an object into a mesh that it has to itself, and
    builds the ray-casting tree anew at every pose. With a second user it keeps the tree.
    """
    twin = bpy.data.objects.new("twin", head.data)
    twin.visible_camera = twin.visible_diffuse = twin.visible_glossy = False
    twin.visible_transmission = twin.visible_shadow = False
    # Visible to nothing at all it would be left out; nothing here scatters in a volume.
    twin.visible_volume_scatter = True
    return twin


def _build_head(mesh: HeadMesh, settings: RenderSettings) -> bpy.types.Object:
    made = bpy.data.meshes.new("head")
    faces = len(mesh.triangles)
    vertices = (mesh.vertices * METRES) @ BLENDER_FROM_GRAPHICS.T
    made.vertices.add(len(vertices))
    made.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    made.loops.add(3 * faces)
    made.loops.foreach_set("vertex_index", mesh.triangles.astype(np.int32).ravel())
    made.polygons.add(faces)
    made.polygons.foreach_set("loop_start", np.arange(0, 3 * faces, 3, dtype=np.int32))
    made.polygons.foreach_set("material_index", mesh.material_index.astype(np.int32))
    made.polygons.foreach_set("use_smooth", np.ones(faces, dtype=bool))
    if mesh.uv is not None:
        layer = made.uv_layers.new(name=UV_MAP)
        layer.uv.foreach_set("vector", mesh.uv.astype(np.float32).ravel())
    if mesh.vertex_colors is not None:
        colors = np.ones((len(vertices), 4), dtype=np.float32)
        colors[:, :3] = mesh.vertex_colors
        attribute = made.color_attributes.new(VERTEX_COLORS, "BYTE_COLOR", "POINT")
        attribute.data.foreach_set("color_srgb", colors.ravel())
    made.update(calc_edges=True)
    for material in mesh.materials:
        made.materials.append(
            build_material(material, settings, has_vertex_colors=mesh.vertex_colors is not None)
        )
    return bpy.data.objects.new("head", made)


def _build_camera(scene: bpy.types.Scene, settings: RenderSettings, distance_mm: float) -> None:
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    data.lens = settings.lens_mm
    if settings.projection == "orthographic":
        data.type = "ORTHO"
        view = Camera(settings.resolution, settings.lens_mm, distance_mm, "orthographic")
        data.ortho_scale = view.view_mm * METRES
    data.clip_start = 0.01 * distance_mm * METRES
    data.clip_end = 100 * distance_mm * METRES
    camera = bpy.data.objects.new("camera", data)
    # A Blender camera looks along its own -z; a quarter turn about x makes that +y, into the scene.
    camera.matrix_world = Matrix.Translation((0, -distance_mm * METRES, 0)) @ Matrix.Rotation(
        np.pi / 2, 4, "X"
    )
    scene.collection.objects.link(camera)
    scene.camera = camera


def _set_render(scene: bpy.types.Scene, settings: RenderSettings, threads: int) -> None:
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = settings.resolution
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    render.use_file_extension = False
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    render.dither_intensity = 0.0
    render.threads_mode = "FIXED" if threads else "AUTO"
    if threads:
        render.threads = threads

    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = settings.samples
    cycles.seed = 0
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.use_light_tree = False
    fast = settings.preset == "fast"
    bounces = 0 if fast else QUALITY_BOUNCES
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.transparent_max_bounces = 8
    cycles.caustics_reflective = cycles.caustics_refractive = False

    view = scene.view_settings
    scene.display_settings.display_device = "sRGB"
    view.view_transform, view.look = "Standard", "None"
    view.exposure, view.gamma = 0.0, 1.0

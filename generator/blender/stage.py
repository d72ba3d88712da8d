# SPDX-License-Identifier: GPL-3.0-or-later
"""One head before a camera and a light: built once a head, set once a view."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import bpy
import numpy as np
from mathutils import Matrix

from generator.blender.fast_light import OPENNESS, FastLight
from generator.blender.light import Light, build_light
from generator.blender.materials import UV_MAP, VERTEX_COLORS, build_material, set_gloss
from generator.blender.needs import Needs
from generator.blender.skin import relief_of
from generator.geometry.camera import SENSOR_MM, Camera
from generator.geometry.rotation import (
    BLENDER_FROM_GRAPHICS,
    blender_rotation,
    rotation_from_angles,
)
from generator.heads.mesh import HeadMesh
from generator.heads.shine import Kinds
from generator.plan.environment_light import EnvironmentLight
from generator.plan.render_settings import is_denoised
from generator.plan.settings import Look
from generator.plan.views import View
from generator.plan.wear import Worn

METRES = 1e-3
"""Blender units (metres) in a millimetre."""

AWAY = Matrix.Translation((0.0, -1000.0, 0.0))
"""Far behind the camera, where no ray comes near."""

QUALITY_BOUNCES = 2

_HEAD = ""
"""Among packages, the head."""

TRANSPARENT_LAYERS = 8
"""Through which a ray goes."""


class Stage:
    """A head, its light and its camera in an empty scene.

    Parameters
    ----------
    mesh: frame U, mm, pivot at the origin.
    look: of the first view. Its preset and samples stay; see :meth:`fits`.
    threads: of Cycles; 0 lets Blender take every core. needs: what looks after the first need, besides.

    Raises FileNotFoundError or RuntimeError if a texture cannot be read.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        mesh: HeadMesh,
        look: Look,
        *,
        threads: int = 0,
        needs: Needs | None = None,
    ) -> None:
        self.scene = scene
        self._kind = _kind(look)
        self.needs = needs or Needs.of(look)
        self._fast = FastLight(self.needs) if look.preset == "fast" else None
        self._worn: dict[str, list[bpy.types.Object]] = {}
        self._kinds: dict[str, Kinds] = {}
        self._on: list[str] = []
        own = self._make("head", mesh, _HEAD)
        self.head = own[0]
        for thing in own:
            scene.collection.objects.link(thing)
        self._light: Light = build_light(scene, self.needs, self._fast)
        self._camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(self._camera)
        scene.camera = self._camera
        _set_render(scene, look, threads)
        self._seen_by: Camera | None = None
        self._lit: tuple[Look, EnvironmentLight | None, float] | None = None

    def fits(self, look: Look, environment: bool = False) -> bool:
        """Can this stage show a look, lit by a panorama or not?

        Another preset has other materials, and Cycles keeps the sampling pattern of its first number of
        samples: the image would depend on what was rendered before. In the fast preset a stage that can do
        more than a look needs shows it, too, to the same pixels.
        """
        wanted = Needs.of(look, environment)
        able = self.needs.cover(wanted) if look.preset == "fast" else self.needs == wanted
        return able and _kind(look) == self._kind

    def show(
        self, view: View, environment: EnvironmentLight | None = None, worn: Sequence[Worn] = ()
    ) -> None:
        """Set pose, camera, look and what is worn, which :meth:`hang` brought. What stays as it was is not
        touched. ValueError if it does not fit."""
        if not self.fits(view.look, environment is not None):
            raise ValueError(f"a stage for {self._kind} cannot show {_kind(view.look)}")
        turn(self.head, view.pose)
        if worn:
            self.see_through_all()
        else:
            self.scene.cycles.min_transparent_bounces = 0
        self._put_on([one.package for one in worn])
        for one in worn:
            moved = METRES * (np.array(one.offset_mm) @ BLENDER_FROM_GRAPHICS.T)
            on = self._worn[one.package][0]
            on.matrix_world = self.head.matrix_world @ Matrix.Translation(moved.tolist())
        if view.camera != self._seen_by:
            set_camera(self.scene, self._camera, view.camera)
            self._seen_by = view.camera
        # Only relief asks for it, and what stays as it was is not compiled again.
        pixel_mm = view.camera.view_mm / view.camera.width if view.look.skin_detail else 1.0
        lit = view.look, environment, pixel_mm
        if lit != self._lit:
            self._set_light(view.look, environment, pixel_mm)
            self._lit = lit

    def expect(self, looks: Iterable[tuple[Look, EnvironmentLight | None, Sequence[Worn]]]) -> None:
        """What is shown next, in order, of what :meth:`hang` brought: it takes less time, and is the same."""
        if self._fast is not None:
            self._fast.expect(
                (look, environment, self._kinds_of([one.package for one in worn]))
                for look, environment, worn in looks
            )

    def see_through_all(self) -> None:
        """Leave nothing to chance of what is seen through several layers; a head alone always did."""
        self.scene.cycles.min_transparent_bounces = TRANSPARENT_LAYERS

    def hang(self, worn: Mapping[str, HeadMesh]) -> None:
        """Have these things at hand, by their package, and no others."""
        for package in [*self._worn]:
            if package not in worn:
                self._put_on([other for other in self._on if other != package])
                self._remove(self._worn.pop(package))
                del self._kinds[package]
        for package, mesh in worn.items():
            if package not in self._worn:
                self._worn[package] = self._make("worn", mesh, package)
                for thing in self._worn[package]:
                    self.scene.collection.objects.link(thing)
                self._take_off(package)

    @property
    def objects(self) -> list[bpy.types.Object]:
        """The head, and what it wears now."""
        return [self.head, *(self._worn[package][0] for package in self._on)]

    @property
    def at_hand(self) -> list[bpy.types.Object]:
        """The head, and what it wears in some view."""
        return [self.head, *(thing[0] for thing in self._worn.values())]

    def _set_light(self, look: Look, environment: EnvironmentLight | None, pixel_mm: float) -> None:
        sheets = self._light.set(look, environment, self._kinds_of(self._on))
        octaves, lean = relief_of(look.skin_detail, pixel_mm)
        for thing, package in zip(self.objects, (_HEAD, *self._on), strict=True):
            thing.color = (octaves, sheets[self._kinds[package]], lean, 1.0)
            if self._fast is None:
                for material in thing.data.materials:
                    set_gloss(material, look.gloss)

    def _put_on(self, packages: Sequence[str]) -> None:
        """Have the head wear these things, and no others."""
        for package in [*self._on]:
            if package not in packages:
                self._on.remove(package)
                self._take_off(package)
        for package in packages:
            if package not in self._on:
                self._on.append(package)
                if self._fast is None:
                    set_seen(self._worn[package][0], True)
                self._lit = None

    def _take_off(self, package: str) -> None:
        """Away with it, where no ray of the camera comes near, and no other meets it. It stays in the scene:
        taken out of it, it would be prepared anew the next time."""
        self._worn[package][0].matrix_world = AWAY
        if self._fast is None:
            set_seen(self._worn[package][0], False)

    def _kinds_of(self, worn: Iterable[str]) -> tuple[Kinds, ...]:
        """Each once, of the head and of what it wears, whatever it put on first."""
        return tuple(sorted({self._kinds[package] for package in (_HEAD, *worn)}, key=str))

    def _make(self, name: str, mesh: HeadMesh, package: str) -> list[bpy.types.Object]:
        """An object and, for the fast preset, its twin; not in the scene yet."""
        self._kinds[package] = () if self._fast is None else self._fast.kinds(mesh.materials)
        made = _build_object(name, mesh, self._fast, self.needs)
        # Path tracing meets the mesh so often that a tree of its own, built anew, is the quicker one.
        return [made] if self._fast is None else [made, _unseen_twin(made)]

    def _remove(self, things: Sequence[bpy.types.Object]) -> None:
        mesh = things[0].data
        materials = list(mesh.materials)
        for thing in things:
            bpy.data.objects.remove(thing)
        bpy.data.meshes.remove(mesh)
        for material in materials:
            bpy.data.materials.remove(material)


def set_seen(thing: bpy.types.Object, seen: bool) -> None:
    """Let rays meet an object or not. Its geometry stays with the renderer, which hiding would cost."""
    for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
        setattr(thing, f"visible_{ray}", seen)
    # Visible to nothing at all it would be left out; nothing here scatters in a volume.
    thing.visible_volume_scatter = True


def _kind(look: Look) -> tuple[str, int]:
    return look.preset, look.cycles_samples


def turn(head: bpy.types.Object, ypr_deg: Sequence[float]) -> None:
    """Set the head's rotation to R_B of (yaw, pitch, roll) in degrees."""
    rotation = blender_rotation(rotation_from_angles(np.asarray(ypr_deg, dtype=np.float64)))
    head.matrix_world = Matrix(rotation.tolist()).to_4x4()


def set_camera(scene: bpy.types.Scene, thing: bpy.types.Object, camera: Camera) -> None:
    """Make Blender's camera see what a camera of ours sees, to the last digit of float32."""
    set_lens(thing.data, camera, METRES)
    # A Blender camera looks along its own -z; a quarter turn about x makes that +y, into the scene.
    away = Matrix.Translation((0, -camera.distance_mm * METRES, 0))
    thing.matrix_world = away @ Matrix.Rotation(np.pi / 2, 4, "X")
    scene.render.resolution_x, scene.render.resolution_y = camera.width, camera.height


def set_lens(data: bpy.types.Camera, camera: Camera, unit: float) -> None:
    """All of a camera but where it stands. unit: of Blender's, a millimetre."""
    distance = camera.distance_mm
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    data.lens = camera.lens_mm
    data.type = "PERSP"
    if camera.projection == "orthographic":
        data.type = "ORTHO"
        data.ortho_scale = camera.view_mm * unit
    # Blender counts shifts in widths of the image, and turns the camera's side to where it shifts.
    x, y = camera.centre_px.tolist()
    data.shift_x = 0.5 - x / camera.width
    data.shift_y = (y - camera.height / 2.0) / camera.width
    data.clip_start = 0.01 * distance * unit
    data.clip_end = 100 * distance * unit


def _unseen_twin(head: bpy.types.Object) -> bpy.types.Object:
    """A second user of the head's mesh that no ray can hit.

    Cycles bakes the transform of an object into a mesh that it has to itself, and
    builds the ray-casting tree anew at every pose. With a second user it keeps the tree.
    """
    twin = bpy.data.objects.new("twin", head.data)
    set_seen(twin, False)
    twin.matrix_world = AWAY
    return twin


def _build_object(name: str, mesh: HeadMesh, fast: FastLight | None, needs: Needs) -> bpy.types.Object:
    made = bpy.data.meshes.new(name)
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
    if needs.occlusion and mesh.openness is not None:
        openness = made.attributes.new(OPENNESS, "FLOAT", "POINT").data
        openness.foreach_set("value", mesh.openness.astype(np.float32))
    made.update(calc_edges=True)
    for material in mesh.materials:
        made.materials.append(build_material(material, mesh, fast, needs))
    return bpy.data.objects.new(name, made)


def _set_render(scene: bpy.types.Scene, look: Look, threads: int) -> None:
    """What is the same for every view."""
    render = scene.render
    render.engine = "CYCLES"
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
    cycles.seed = 0
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = is_denoised(look)
    if cycles.use_denoising:
        cycles.denoiser, cycles.denoising_quality = "OPENIMAGEDENOISE", "FAST"
        cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "FAST"
        cycles.denoising_use_gpu = False
    cycles.use_light_tree = False
    cycles.samples = look.cycles_samples
    bounces = 0 if look.preset == "fast" else QUALITY_BOUNCES
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.transparent_max_bounces = TRANSPARENT_LAYERS
    cycles.caustics_reflective = cycles.caustics_refractive = False

    view = scene.view_settings
    scene.display_settings.display_device = "sRGB"
    view.view_transform, view.look = "Standard", "None"
    view.exposure, view.gamma = 0.0, 1.0

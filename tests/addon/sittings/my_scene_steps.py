# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of a user's own, with a head on a plinth. To be imported before ui_driver, as ui_steps is."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

from ui_steps import begin, shown  # isort: skip
from ui_driver import EXTENSION, OUT, Step, Widget, area, click, event, region

HEAD = "Ada"
EYE_LEVEL = 1.6
"""Metres above the floor."""


def open_my_scene(package: Path) -> Iterator[Step]:
    """Have OUT/mine/mine.blend made of a placed head, and open it. The head's texture lies beside it."""
    mesh = import_module(f"{EXTENSION}.generator.heads.package").load_package(package)
    folder = OUT / "mine"
    folder.mkdir()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_factory_startup_app_template_only=True)
    yield 0.5
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    file = folder / "mine.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    head = _head(mesh, folder)
    points = mesh.vertices / 1000
    for one in (_hair(points), *_glasses(points)):
        one.parent = head
    bpy.ops.mesh.primitive_cylinder_add(radius=0.11, depth=0.9, location=(0, 0, EYE_LEVEL - 0.6))
    bpy.context.object.name = "Plinth"
    bpy.data.objects["Light"].location = (1.5, -2, 2.6)
    bpy.data.lights["Light"].energy = 150
    camera = scene.camera
    camera.data.lens, camera.data.sensor_fit = 85, "VERTICAL"
    camera.matrix_world = (
        Matrix.Translation((0.35, -1.7, EYE_LEVEL - 0.04))
        @ Matrix.Rotation(math.radians(11), 4, "Z")
        @ Matrix.Rotation(math.radians(90), 4, "X")
    )
    scene.render.engine, scene.cycles.samples = "CYCLES", 4
    scene.frame_start, scene.frame_end, scene.frame_current = 10, 77, 33
    scene.render.resolution_x = scene.render.resolution_y = 720
    space = area().spaces.active
    space.region_3d.view_perspective, space.shading.color_type = "CAMERA", "TEXTURE"
    space.region_3d.view_camera_zoom, space.region_3d.view_camera_offset = 24, (0.07, 0.0)
    for one in bpy.context.selected_objects:
        one.select_set(False)
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.open_mainfile(filepath=str(file))
    yield 1.0
    yield from begin()


def select_my_head() -> Iterator[Step]:
    """Click on it."""
    view, seen = region("WINDOW"), area().spaces.active.region_3d
    place = location_3d_to_region_2d(view, seen, bpy.data.objects[HEAD].matrix_world.translation)
    yield from click(view.x + round(place.x), view.y + round(place.y))
    yield lambda: bpy.data.objects[HEAD].select_get()


def open_my_panel() -> Iterator[Step]:
    """Click on the header of *Head in Your Scene*, the first one of the tab."""
    side = region("UI")
    yield from click(side.x + side.width // 3, side.y + side.height - 13)


def press(button: Widget) -> Iterator[Step]:
    """Press a button, and take the mouse away."""
    yield from click(*button.middle)
    event("MOUSEMOVE", "NOTHING", 640, 8)


def turntable() -> bpy.types.Object | None:
    """Ours under the head, if there is one."""
    return import_module(f"{EXTENSION}.turntable").find(bpy.context.scene)


def tiny() -> None:
    """Three poses, small, into the folder OUT/ada."""
    for name in ("pitch", "roll"):
        setattr(shown(), f"poses_{name}", (0, 0, 10))
    shown().poses_yaw, shown().render_resolution, shown().workers = (-20, 20, 20), 64, 1
    shown().out = str(OUT / "ada")


def _head(mesh: Any, folder: Path) -> bpy.types.Object:
    made = bpy.data.meshes.new(HEAD)
    made.from_pydata((mesh.vertices / 1000).tolist(), [], mesh.triangles.tolist())
    made.polygons.foreach_set("use_smooth", np.ones(len(made.polygons), dtype=bool))
    made.polygons.foreach_set("material_index", mesh.material_index)
    made.uv_layers.new(name="UV").data.foreach_set("uv", mesh.uv.astype(np.float32).ravel())
    for known in mesh.materials:
        texture = None if known.texture is None else shutil.copy(known.texture, folder)
        made.materials.append(_material(known.name, known.base_color, texture))
    head = bpy.data.objects.new(HEAD, made)
    bpy.context.scene.collection.objects.link(head)
    head.matrix_world = Matrix.Translation((0, 0, EYE_LEVEL)) @ Matrix.Rotation(math.radians(90), 4, "X")
    return head


def _material(name: str, colour: tuple[float, ...], texture: str | None = None) -> bpy.types.Material:
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.diffuse_color = (*colour, 1)
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    if texture is not None:
        image = made.node_tree.nodes.new("ShaderNodeTexImage")
        image.image = bpy.data.images.load(texture)
        made.node_tree.links.new(image.outputs["Color"], shader.inputs["Base Color"])
    return made


def _hair(points: np.ndarray) -> bpy.types.Object:
    """Strands of 4 cm from the crown, combed backwards."""
    roots = points[points[:, 1] > points[:, 1].max() - 0.05]
    outwards = roots / np.linalg.norm(roots, axis=1, keepdims=True)
    steps = np.linspace(0, 1, 6)[None, :, None]
    strands = roots[:, None] + 0.012 * outwards[:, None] * steps + np.array([0, 0, -0.03]) * steps**2
    data = bpy.data.hair_curves.new("Hair")
    data.add_curves([6] * len(roots))
    data.position_data.foreach_set("vector", strands.astype(np.float32).ravel())
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(6 * len(roots), 6e-4, dtype=np.float32))
    data.materials.append(_material("Hair", (0.12, 0.06, 0.03)))
    hair = bpy.data.objects.new("Hair", data)
    bpy.context.scene.collection.objects.link(hair)
    return hair


def _glasses(points: np.ndarray) -> list[bpy.types.Object]:
    """Two rims and what joins them, in the head's own axes."""
    near = points[(np.abs(np.abs(points[:, 0]) - 0.03) < 0.02) & (np.abs(points[:, 1]) < 0.02)]
    front = float(near[:, 2].max()) + 0.012
    side = float(np.abs(points[np.abs(points[:, 1]) < 0.02][:, 0]).max())
    frame, made = _material("Acetate", (0.25, 0.1, 0.03)), []
    frame.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 0.6
    for x in (-0.033, 0.033):
        bpy.ops.mesh.primitive_torus_add(location=(x, 0, front), major_radius=0.025, minor_radius=0.0018)
        made.append(bpy.context.object)
    for a, b in (
        ((-0.009, 0.006, front), (0.009, 0.006, front)),
        ((-0.058, 0.006, front), (-side, 0.006, 0)),
        ((0.058, 0.006, front), (side, 0.006, 0)),
    ):
        way = Vector(b) - Vector(a)
        bpy.ops.mesh.primitive_cylinder_add(radius=0.0018, depth=way.length)
        rod = bpy.context.object
        rod.matrix_world = (
            Matrix.Translation((Vector(a) + Vector(b)) / 2) @ way.to_track_quat("Z", "Y").to_matrix().to_4x4()
        )
        made.append(rod)
    for one in made:
        one.name = "Glasses"
        one.data.materials.append(frame)
    return made

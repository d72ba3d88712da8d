# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes whose head has hair alone: what Cycles draws of it, and the tubes of it. For many_scenes.py."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from PIL import Image, ImageDraw

from generator.blender.scene_head import SceneHead
from generator.blender.scene_strands import strands

SIDE, ACROSS, FINER = 96, 7.0, 16
"""Pixels of a picture, Blender's units across it, and lines of the tubes' shadow in a pixel."""

TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
PIVOT = np.array([0.4, 0.0, 0.0])
KINDS = ("own", "children", "hidden", "curves")


def how_hair_is_seen(folder: Path) -> dict[str, dict[str, float]]:
    """Of each kind, before and after a turn: pixels covered as drawn, and by the tubes, and how alike."""
    return {kind: _seen(kind, folder) for kind in KINDS}


def _seen(kind: str, folder: Path) -> dict[str, float]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    _haired(kind)
    _camera()
    file = folder / f"hair-{kind}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    head = SceneHead(file, "Head")
    found = strands({*head.objects})
    if found is None:
        return {"drawn": float(_drawn(file).sum()), "tubes": 0.0}
    straight = _alike(_drawn(file), found.vertices, found.triangles)
    head.turn(TURN, PIVOT)
    turned = _alike(_drawn(file), (found.vertices - PIVOT) @ TURN.T + PIVOT, found.triangles)
    return {**straight, **{f"turned {name}": value for name, value in turned.items()}}


def _haired(kind: str) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    head = bpy.context.object
    head.name, head.scale = "Head", (1.2, 1.2, 1.2)
    head.location, head.rotation_euler = (0.3, -0.2, 0.1), (0.2, 0.3, 0.4)
    if kind == "curves":
        bpy.ops.object.curves_random_add()
        bpy.context.object.parent = head
        head.visible_camera = False
        return
    modifier = head.modifiers.new("Hair", "PARTICLE_SYSTEM")
    modifier.show_render = kind != "hidden"
    head.show_instancer_for_render = False
    settings = head.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 40, 0.8
    settings.radius_scale, settings.tip_radius, settings.shape = 0.1, 0.3, -0.5
    settings.display_step, settings.render_step, settings.display_percentage = 1, 3, 10
    if kind == "children":
        settings.child_type, settings.child_percent, settings.rendered_child_count = "SIMPLE", 0, 4
        settings.shape, settings.use_close_tip = 0.4, False


def _camera() -> None:
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", ACROSS
    camera.matrix_world = Matrix.Translation((0, 0, 10))
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine, render.film_transparent = "CYCLES", True
    render.resolution_x = render.resolution_y = SIDE
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.pixel_filter_type = 8, False, "BOX"
    render.image_settings.file_format, render.image_settings.color_mode = "OPEN_EXR", "RGBA"


def _drawn(file: Path) -> np.ndarray:
    """Coverage of each pixel, rows from below."""
    bpy.context.scene.render.filepath = str(file.with_suffix(".exr"))
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(bpy.context.scene.render.filepath)
    found = np.array(image.pixels[:]).reshape(SIDE, SIDE, 4)[..., 3]
    bpy.data.images.remove(image)
    return found


def _alike(drawn: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> dict[str, float]:
    picture = Image.new("L", (SIDE * FINER, SIDE * FINER))
    draw = ImageDraw.Draw(picture)
    for corners in ((vertices[:, :2] / ACROSS + 0.5) * SIDE * FINER)[triangles]:
        draw.polygon([*map(tuple, corners.tolist())], fill=255)
    tubes = np.asarray(picture.resize((SIDE, SIDE), Image.Resampling.BOX), dtype=float) / 255
    alike = np.corrcoef(drawn.ravel(), tubes.ravel())[0, 1]
    return {"drawn": float(drawn.sum()), "tubes": float(tubes.sum()), "alike": float(alike)}

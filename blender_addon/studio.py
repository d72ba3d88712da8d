# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene in which one head stands before the camera and light of the build."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from generator.blender.scene import METRES, fill_scene, turn
from generator.plan.render_settings import RenderSettings

from generator.blender.materials import srgb_to_linear
from generator.geometry.camera import framing_distance
from generator.heads.package import load_package

from . import landmarks, overlay, session, settings
from .core.grid import snapped

if TYPE_CHECKING:
    from .properties import HeadturnSettings

SCENE = "Headturn"
PRESET_SAMPLES = {"fast": 1, "quality": 4}
MARGIN = 1.05


def studio_scene() -> bpy.types.Scene:
    """The scene of the heads, made with the settings of the current one; the user's own stay as they are."""
    current = bpy.context.scene
    if current.headturn.head is not None or current.name.startswith(SCENE):
        return current
    scene = bpy.data.scenes.new(SCENE)
    with session.quiet():
        for name in set(current.headturn.bl_rna.properties.keys()) - {"rna_type", "name", "head", "gallery"}:
            setattr(scene.headturn, name, getattr(current.headturn, name))
    for window in bpy.context.window_manager.windows:
        if window.scene == current:
            window.scene = scene
    return scene


def show_package(scene: bpy.types.Scene, package: Path, radius_mm: float) -> None:
    """Put a prepared head into the scene. Raises HeadError or OSError if it cannot be read."""
    shown = scene.headturn
    shown.package, shown.radius_mm = str(package), radius_mm
    rebuild(scene)
    show_views(shown)
    overlay.ensure()


def rebuild(scene: bpy.types.Scene) -> None:
    """Head, camera, light and render settings, anew."""
    shown = scene.headturn
    mesh = load_package(Path(shown.package))
    through_camera = [view for view in _views(scene) if view.region_3d.view_perspective == "CAMERA"]
    clear(scene)
    head = fill_scene(scene, mesh, render_settings(shown), distance_mm(shown))
    for other in [o for o in scene.objects if o.data == head.data and o != head]:
        bpy.data.objects.remove(other)  # a help for final renders that would show in a viewport
    scene.cycles.preview_samples = max(scene.cycles.samples, 4)
    scene.cycles.use_preview_denoising = False
    scene.camera.data.passepartout_alpha = 1.0
    for thing in scene.objects:
        thing.hide_select = True
    shown.head = head
    turn(head, pose(shown))
    for view in through_camera:
        view.region_3d.view_perspective = "CAMERA"


def clear(scene: bpy.types.Scene) -> None:
    """Remove what :func:`rebuild` made, with its data."""
    for thing in list(scene.objects):
        data = thing.data
        materials = list(data.materials) if isinstance(data, bpy.types.Mesh) else []
        bpy.data.objects.remove(thing)
        for left in (data, *materials):  # in this order: a mesh is a user of its materials
            if left is not None and not left.users:
                bpy.data.batch_remove([left])
    if scene.world is not None and scene.world.users == 1:
        bpy.data.worlds.remove(scene.world)


def pose(shown: HeadturnSettings) -> tuple[float, float, float]:
    """(yaw, pitch, roll) that is shown, degrees."""
    return shown.yaw, shown.pitch, shown.roll


def render_settings(shown: HeadturnSettings) -> RenderSettings:
    """What the build's render worker would get."""
    table = settings.to_config(shown)["render"]
    return RenderSettings.from_dict({"samples": PRESET_SAMPLES[shown.preset], **table})


def distance_mm(shown: HeadturnSettings) -> float:
    """Camera to pivot, as a build computes it."""
    look = render_settings(shown)
    if look.distance_mm is not None:
        return look.distance_mm
    return round(framing_distance(shown.radius_mm, look.lens_mm, look.margin, look.projection), 2)


def set_pose(shown: HeadturnSettings, angles: tuple[float, float, float]) -> None:
    """Show a pose, all three angles at once."""
    with session.quiet():
        shown.yaw, shown.pitch, shown.roll = angles
    pose_changed(shown)


def pose_changed(shown: HeadturnSettings) -> None:
    """A slider moved: turn the head. Nothing is rebuilt."""
    if session.is_quiet():
        return
    if shown.snap and shown.plan == "grid":
        with session.quiet():
            for name in settings.RANGES:
                axis = getattr(shown, f"{name}_range")
                if axis[2] > 0:
                    setattr(shown, name, snapped(getattr(shown, name), axis))
    if shown.head is not None:
        turn(shown.head, pose(shown))
        landmarks.pose_changed(shown)


def look_changed(scene: bpy.types.Scene) -> None:
    """Camera, light or preset changed."""
    if not session.is_quiet() and scene.headturn.head is not None:
        rebuild(scene)
        landmarks.pose_changed(scene.headturn)


def show_views(shown: HeadturnSettings) -> None:
    """Every 3D view of the scene looks through its camera, shaded as chosen."""
    for space in _views(shown.id_data):
        space.region_3d.view_perspective = "CAMERA"
        space.region_3d.view_camera_zoom = 0
        space.region_3d.view_camera_offset = (_free_middle(space), 0)
        space.shading.type = shown.viewport
        space.shading.light = "FLAT"
        space.shading.color_type = "TEXTURE"
        space.shading.background_type = "VIEWPORT"
        space.shading.background_color = srgb_to_linear(tuple(shown.background))
    session.redraw_views()


def _views(scene: bpy.types.Scene) -> list[bpy.types.SpaceView3D]:
    """The 3D views that show a scene."""
    return [
        area.spaces.active
        for window in bpy.context.window_manager.windows
        if window.scene == scene
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def _free_middle(space: bpy.types.SpaceView3D) -> float:
    """Offset of the camera's image that puts it in the middle of what the sidebar leaves free."""
    area = next(a for a in space.id_data.areas if a.spaces.active == space)
    wide = next(region.width for region in area.regions if region.type == "WINDOW")
    high = next(region.height for region in area.regions if region.type == "WINDOW")
    side = next(region.width for region in area.regions if region.type == "UI")
    return side / 2 / max(wide, high) / 2 if side > 1 else 0.0


def head_axes(shown: HeadturnSettings) -> np.ndarray:
    """End points of the head's frame in Blender's world, float [4, 3]: pivot, left, up, front."""
    reach = 1.25 * shown.radius_mm * METRES
    ends = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, -1, 0]]) * reach
    matrix = np.array(shown.head.matrix_world)
    return ends @ matrix[:3, :3].T + matrix[:3, 3]

# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene in which one head stands before the camera and light of the build."""

from __future__ import annotations

from pathlib import Path

import bpy

from generator import registries
from generator.blender.materials import srgb_to_linear
from generator.blender.stage import Stage, turn
from generator.errors import HeadturnError
from generator.heads.package import load_package
from generator.plan.poses import ANGLES
from generator.plan.view_plan import plan_views
from generator.plan.views import View

from . import landmarks, overlay, session, settings, stages, windows
from .core.grid import snapped
from .session import Shown

SCENE = "Headturn"
NOT_COPIED = {"rna_type", "name", "head", "gallery"}
PREVIEW_SAMPLES = 4
"""At least so many in a 3D view: one sample has jagged edges."""


def studio_scene() -> bpy.types.Scene:
    """The scene of the heads, made with the settings of the current one; the user's own stay as they are."""
    current = bpy.context.scene
    if current.headturn.head is not None or current.name.startswith(SCENE):
        return current
    scene = bpy.data.scenes.new(SCENE)
    with session.quiet():
        for name in set(current.headturn.bl_rna.properties.keys()) - NOT_COPIED:
            setattr(scene.headturn, name, getattr(current.headturn, name))
    for window in bpy.context.window_manager.windows:
        if window.scene == current:
            window.scene = scene
    return scene


def show_package(scene: bpy.types.Scene, package: Path, radius_mm: float) -> None:
    """Put a prepared head into the scene. Raises HeadError or OSError if it cannot be read."""
    shown = scene.headturn
    shown.package, shown.radius = str(package), repr(float(radius_mm))
    rebuild(scene)
    show_views(shown)
    overlay.ensure()


def view_of(shown: Shown) -> View:
    """What the build would render of the head at this pose."""
    head = "/".join(settings.chosen_head(shown))
    return plan_views(settings.planned(shown), head, settings.radius_mm(shown), [settings.pose(shown)])[0]


def rebuild(scene: bpy.types.Scene) -> None:
    """Head, camera, light and render settings, anew. Raises HeadError, OSError or RuntimeError."""
    shown = scene.headturn
    mesh, view = load_package(Path(shown.package)), view_of(shown)
    through_camera = [space for space in _views(scene) if space.region_3d.view_perspective == "CAMERA"]
    clear(scene)
    stage = Stage(scene, mesh, view.look)
    for other in [o for o in scene.objects if o.data == stage.head.data and o != stage.head]:
        bpy.data.objects.remove(other)  # a help for final renders that would show in a viewport
    scene.cycles.preview_samples = max(view.look.cycles_samples, PREVIEW_SAMPLES)
    scene.cycles.use_preview_denoising = False
    scene.camera.data.passepartout_alpha = 1.0
    for thing in scene.objects:
        thing.hide_select = True
    shown.head = stage.head
    stages.keep(scene, stage)
    _show(scene, stage, view)
    for space in through_camera:
        space.region_3d.view_perspective = "CAMERA"


def clear(scene: bpy.types.Scene) -> None:
    """Remove what :func:`rebuild` made, with its data."""
    for thing in list(scene.objects):
        data = thing.data
        materials = list(data.materials) if isinstance(data, bpy.types.Mesh) else []
        groups = {
            node.node_tree
            for material in materials
            for node in (material.node_tree.nodes if material and material.node_tree else ())
            if node.type == "GROUP"
        }
        bpy.data.objects.remove(thing)
        for left in (data, *materials, *groups):  # in this order: each is a user of those after it
            if left is not None and not left.users:
                bpy.data.batch_remove([left])
    if scene.world is not None and scene.world.users == 1:
        bpy.data.worlds.remove(scene.world)


def set_pose(shown: Shown, angles: tuple[float, float, float]) -> None:
    """Show a pose, all three angles at once."""
    with session.quiet():
        shown.yaw, shown.pitch, shown.roll = angles
    pose_changed(shown)


def pose_changed(shown: Shown) -> None:
    """A slider moved: turn the head. Nothing is rebuilt."""
    if shown.snap and shown.poses_kind == "grid":
        with session.quiet():
            for name in ANGLES:
                axis = getattr(shown, f"poses_{name}")
                if axis[2] > 0:
                    setattr(shown, name, snapped(getattr(shown, name), axis))
    if shown.head is None:
        return
    if len(registries.DRAWS):  # camera and look may be drawn for each pose
        look_changed(shown.id_data)
        return
    turn(shown.head, settings.pose(shown))
    landmarks.pose_changed(shown)


def look_changed(scene: bpy.types.Scene) -> None:
    """Camera or look changed: they are set, or the scene is built anew where the stage does not fit them."""
    shown = scene.headturn
    if shown.head is None:
        return
    stage, view = stages.kept(scene), view_of(shown)
    try:
        if stage is None or not stage.fits(view.look):
            rebuild(scene)
        else:
            _show(scene, stage, view)
    except (HeadturnError, OSError, RuntimeError) as error:  # the package went with the Blender that made it
        session.conversation.fail(f"{' '.join(str(error).split())}; load the heads again")
        return
    landmarks.pose_changed(shown)


def show_views(shown: Shown) -> None:
    """Every 3D view of the scene looks through its camera, shaded as chosen."""
    for space in _views(shown.id_data):
        space.region_3d.view_perspective = "CAMERA"
        space.region_3d.view_camera_zoom = 0
        space.region_3d.view_camera_offset = (_free_middle(space), 0)
        space.shading.type = shown.viewport
        space.shading.light = "FLAT"
        space.shading.color_type = "TEXTURE"
    _show_background(shown)
    windows.redraw_views()


def _show(scene: bpy.types.Scene, stage: Stage, view: View) -> None:
    stage.show(view)
    _show_background(scene.headturn)


def _show_background(shown: Shown) -> None:
    for space in _views(shown.id_data):
        if space.region_3d.view_perspective == "CAMERA":
            space.shading.background_type = "VIEWPORT"
            space.shading.background_color = srgb_to_linear(tuple(shown.render_background))


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

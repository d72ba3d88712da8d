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

from . import keys, landmarks, overlay, own, session, settings, stages, views, windows
from .core.grid import snapped
from .core.units import is_angle
from .session import Shown

STUDIO = "studio"
"""What a scene of ours is kept as."""

OF_ONE_SCENE = {"rna_type", "name", "head", "gallery", "package", "radius", "placed", "came_from", "frames"}
"""Properties that say what a scene shows; all others are settings, which go along."""

PREVIEW_SAMPLES = 4
"""At least so many in a 3D view: one sample has jagged edges."""


def studio_scene(current: bpy.types.Scene) -> bpy.types.Scene:
    """The scene of the heads of a scene, with its settings; made if there is none. His stays as it is."""
    if own.is_own(current):
        return current
    scene = next((one for one in own.scenes() if one.headturn.came_from == current), None)
    if scene is None:
        scene = bpy.data.scenes.new(own.NAME)
        own.keep(scene, STUDIO)
        scene.headturn.came_from = current
    copy_settings(current.headturn, scene.headturn)
    for window in bpy.context.window_manager.windows:
        if window.scene == current:
            window.scene = scene
    return scene


def copy_settings(given: Shown, to: Shown) -> None:
    """Have the settings of another scene."""
    with session.quiet():
        for name in _settable(given) - OF_ONE_SCENE:
            setattr(to, name, getattr(given, name))


def _settable(shown: Shown) -> set[str]:
    """Names of properties that do not only show another one."""
    return {name for name in shown.bl_rna.properties.keys() if not is_angle(name)}  # noqa: SIM118


def own_scene(studio: bpy.types.Scene) -> bpy.types.Scene | None:
    """The user's scene that a scene of ours came from, or another one of his; None if there is none."""
    others = [scene for scene in bpy.data.scenes if not own.is_own(scene)]
    came_from = studio.headturn.came_from
    return came_from if came_from in others else next(iter(others), None)


def leave(studio: bpy.types.Scene, to: bpy.types.Scene) -> None:
    """Every window that shows a scene of ours shows one of the user's, as it was. The settings go along."""
    copy_settings(studio.headturn, to.headturn)
    for window in bpy.context.window_manager.windows:
        if window.scene == studio:
            window.scene = to
    views.give_back()
    windows.redraw_views()


def remove() -> list[str]:
    """Everything of ours goes from this file. Returns scenes that stay: they hold something of the user's."""
    for scene in own.scenes():
        to = own_scene(scene)
        if to is not None:
            leave(scene, to)
    stages.forget()
    stay = [scene.name for scene in own.remove_all()]
    views.give_back()
    with session.quiet():
        for scene in bpy.data.scenes:
            for name in _settable(scene.headturn) - {"rna_type", "name", "gallery"}:
                scene.headturn.property_unset(name)
    windows.redraw_views()
    return stay


def show_package(scene: bpy.types.Scene, package: Path, radius_mm: float, placed: str = "") -> None:
    """Put a prepared head into a scene of ours. placed: see :class:`Placed`.

    Raises HeadError or OSError if it cannot be read; then the scene shows what it showed.
    """
    assert own.is_own(scene), "heads stand in scenes of ours alone"
    shown = scene.headturn
    before = shown.package, shown.radius, shown.placed
    shown.package, shown.radius, shown.placed = str(package), repr(float(radius_mm)), placed
    try:
        rebuild(scene)
    except (HeadturnError, OSError, RuntimeError):
        shown.package, shown.radius, shown.placed = before
        raise
    show_views(shown)
    overlay.ensure()
    landmarks.pose_changed(shown)


def view_of(shown: Shown) -> View:
    """What the build would render of the head at this pose."""
    head = "/".join(keys.viewed(shown))
    return plan_views(settings.planned(shown), head, settings.radius_mm(shown), [settings.pose(shown)])[0]


def rebuild(scene: bpy.types.Scene) -> None:
    """Head, camera, light and render settings, anew. Raises HeadError, OSError or RuntimeError."""
    shown = scene.headturn
    mesh, view = load_package(Path(shown.package)), view_of(shown)
    through_camera = [space for space in _views(scene) if space.region_3d.view_perspective == "CAMERA"]
    before, was = own.things(scene), (scene.world, scene.camera, own.head(shown))
    try:
        with own.making(scene):
            stage = Stage(scene, mesh, view.look)
            stage.show(view)
    except BaseException:
        scene.world, scene.camera, _ = was
        own.remove(thing for thing in own.things(scene) if thing not in before)
        raise
    # A help for final renders that would show in a viewport.
    gone = [one for one in own.things(scene) if one.data == stage.head.data and one != stage.head]
    _succeed(was[2], stage.head)
    if was[1] in before:
        _succeed(was[1], scene.camera)
    shown.head = stage.head
    own.remove([*before, *gone])
    own.pack()
    scene.cycles.preview_samples = max(view.look.cycles_samples, PREVIEW_SAMPLES)
    scene.cycles.use_preview_denoising = False
    scene.camera.data.passepartout_alpha = 1.0
    stages.keep(scene, stage)
    stages.keep_turned(scene, view.pose)
    _show_background(shown)
    for space in through_camera:
        space.region_3d.view_perspective = "CAMERA"


def _succeed(old: bpy.types.Object | None, new: bpy.types.Object) -> None:
    """What the user tied to a thing of ours, a hat to the head, is tied to the one in its place."""
    if old is None:
        return
    for place in old.users_collection:
        if own.is_own(place):
            place.objects.unlink(old)
    old.user_remap(new)


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
    if own.head(shown) is None:
        return
    if len(registries.DRAWS):  # camera and look may be drawn for each pose
        look_changed(shown.id_data)
        return
    _turn(shown)
    landmarks.pose_changed(shown)


def follow_pose(shown: Shown) -> None:
    """The pose may be another one, set by animation, which tells nobody. The head is in view."""
    if stages.turned(shown.id_data) != settings.pose(shown):
        if len(registries.DRAWS):
            look_changed(shown.id_data)
        else:
            _turn(shown)
        landmarks.pose_changed(shown)


def _turn(shown: Shown) -> None:
    turn(shown.head, settings.pose(shown))
    stages.keep_turned(shown.id_data, settings.pose(shown))


def look_changed(scene: bpy.types.Scene) -> None:
    """Camera or look changed: they are set, or the scene is built anew where the stage does not fit them."""
    shown = scene.headturn
    if own.head(shown) is None:
        return
    stage, view = stages.kept(scene), view_of(shown)
    try:
        if stage is None or not stage.fits(view.look):
            rebuild(scene)
        else:
            _show(scene, stage, view)
    except (HeadturnError, OSError, RuntimeError) as error:  # the package went with the Blender that made it
        session.conversation.fail(f"{' '.join(str(error).split())}: Load Heads makes it anew")
        return
    landmarks.pose_changed(shown)


def show_views(shown: Shown) -> None:
    """Every 3D view of the scene looks through its camera, shaded as chosen; without a head none does."""
    if own.head(shown) is None:
        return
    for space in _views(shown.id_data):
        views.keep(space.id_data)
        space.region_3d.view_perspective = "CAMERA"
        space.region_3d.view_camera_zoom = 0
        space.region_3d.view_camera_offset = (_free_middle(space), 0)
        space.shading.type = shown.viewport
        space.shading.light = "FLAT"
        space.shading.color_type = "TEXTURE"
    _show_background(shown)
    windows.redraw_views()


def _show(scene: bpy.types.Scene, stage: Stage, view: View) -> None:
    with own.making(scene):  # another light has another map
        stage.show(view)
    own.pack()
    stages.keep_turned(scene, view.pose)
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

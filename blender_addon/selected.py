# SPDX-License-Identifier: GPL-3.0-or-later
"""The head in the user's own scene: chosen, previewed with its grid on the timeline, built as it stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import bpy

from generator.errors import HeadturnError

from . import build_lines, building, folders, own, session, settings
from .core.labels import one_line
from .registration import WORDS, registering
from .session import Shown
from .tab import Closed

NEUTRAL = "neutral"
Thing = Any
"""An object or a collection."""


class UseSelected(bpy.types.Operator):
    """Turn the selected object or collection of your scene, with all that is parented to it, as the head"""

    bl_idname = "headturn.use_selected"
    bl_label = "Use Selected"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    scene_camera: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Through the Scene's Camera",
        description="See the head through the scene's own camera, from where it stands",
        translation_context=WORDS,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if own.is_own(context.scene):
            cls.poll_message_set("Go back to your own scene first")
            return False
        if chosen(context) is None:
            cls.poll_message_set("Select the head, or its collection")
            return False
        if not context.scene.headturn.out:
            cls.poll_message_set("Choose the folder of the dataset first: a copy of the scene goes beside it")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        thing = chosen(context)
        assert thing is not None, "poll looked"
        try:
            use(context.scene, thing, scene_camera=self.scene_camera)
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        return {"FINISHED"}


class BuildSelected(bpy.types.Operator):
    """Build a dataset of your scene as it stands now. A copy is saved beside the folder of the dataset"""

    bl_idname = "headturn.build_selected"
    bl_label = "Build This Scene"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from . import turntable

        if turntable.find(context.scene) is None:
            cls.poll_message_set("Use Selected first")
            return False
        return bool(bpy.ops.headturn.build.poll())

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            save_copy(context.scene)
        except HeadturnError as error:
            self.report({"ERROR"}, one_line(str(error)))
            return {"CANCELLED"}
        return bpy.ops.headturn.build("INVOKE_DEFAULT")


class LetGo(bpy.types.Operator):
    """Have your head stand as it stood, and take everything of ours out of your scene"""

    bl_idname = "headturn.let_go"
    bl_label = "Let Go of the Head"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        from . import turntable

        return turntable.find(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        let_go(context.scene)
        return {"FINISHED"}


class SelectedPanel(Closed, bpy.types.Panel):
    """The head in the user's own scene."""

    bl_idname = "HEADTURN_PT_selected"
    bl_label = "Head in Your Scene"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not own.is_own(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        column, shown = self.layout.column(), context.scene.headturn
        column.prop(shown, "out", text="")
        column.operator("headturn.use_selected", icon="RESTRICT_SELECT_OFF")
        text = "Use Selected, Scene's Camera"
        button = column.operator("headturn.use_selected", text=text, icon="CAMERA_DATA", translate=False)
        button.scene_camera = True
        is_here = bool(shown.out) and building.current.out == Path(settings.absolute(shown.out))
        if is_here and building.current.runs:
            column.operator("headturn.cancel", icon="CANCEL")
        else:
            column.operator("headturn.build_selected", icon="PLAY")
        column.operator("headturn.let_go", icon="LOOP_BACK")
        if is_here:
            build_lines.draw_now(column, context)


def chosen(context: bpy.types.Context) -> Thing | None:
    """The active object, if it is selected; else the active collection, if it is not all of the scene."""
    active = context.view_layer.objects.active
    if active is not None and active.select_get():
        return active
    found = context.view_layer.active_layer_collection.collection
    return None if found == context.scene.collection else found


def use(scene: bpy.types.Scene, thing: Thing, *, scene_camera: bool) -> None:
    """Have the host place the head in a copy of the file, then hang it on a turntable.

    Raises HeadturnError: the copy cannot be written.
    """
    let_go(scene)
    shown, name, what = scene.headturn, scene.name, thing.name
    config = settings.to_config(shown)
    heads = {"source": str(copy_of(shown)), "head_object": what, "expressions": [NEUTRAL]}
    render = {**config.get("render", {}), "scene_camera": scene_camera}
    settings.from_config(shown, {**config, "heads": heads, "render": render})
    save_copy(scene)
    subject = copy_of(shown).stem
    package = folders.scratch("selected") / f"{subject}.npz"

    def place(_: dict[str, Any]) -> None:
        there = bpy.data.scenes.get(name)
        if there is not None:
            config = settings.to_config(there.headturn)
            message = {"op": "place", **folders.told(config), "subject": subject, "expression": NEUTRAL}
            session.request({**message, "package": str(package)}, f"finding the face of {what}...", take)

    def take(_: dict[str, Any]) -> None:
        there = bpy.data.scenes.get(name)
        if there is not None:
            try:
                placed(there, what, package, scene_camera=scene_camera)
            except (ValueError, OSError, RuntimeError, HeadturnError) as error:
                session.state.error = " ".join(str(error).split())
                return
            bpy.ops.ed.undo_push(message="Use Selected")

    message = {"op": "list", **folders.told(settings.to_config(shown))}
    session.request(message, f"looking at {what}...", place)


def placed(scene: bpy.types.Scene, name: str, package: Path, *, scene_camera: bool) -> None:
    """The host has placed a head: hang it on a turntable, and lay the grid on the timeline.

    Raises ValueError: the object is gone, or the scene's camera cannot be used; OSError: no package.
    """
    from generator.heads.package import load_package

    from . import turntable
    from .core.turning import Turning

    placed_in = load_package(package).scene
    roots = topmost(scene, name)
    if placed_in is None or not roots:
        raise ValueError(f"{name} is not in the scene any more")
    turntable.hang(scene, roots, Turning.of(placed_in, scene_camera=scene_camera))
    follow(scene)


def topmost(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    """The object of a name, or the objects of a collection that hang on no other of it."""
    thing = scene.objects.get(name)
    if thing is not None:
        return [thing]
    found = next((one for one in scene.collection.children_recursive if one.name == name), None)
    inside = {*found.all_objects} if found is not None else set()
    return [one for one in inside if one.parent not in inside]


def follow(scene: bpy.types.Scene, *_: object) -> None:
    """Frame k shows pose k of the plan."""
    from . import turntable
    from .core.grid import plan_poses

    if session.is_quiet() or own.is_own(scene) or turntable.find(scene) is None:
        return
    shown = scene.headturn
    try:
        plan = plan_poses(settings.poses(shown), (copy_of(shown).stem, NEUTRAL))
    except HeadturnError:  # drawn by the host, or none, which the panel says
        turntable.show(scene, settings.pose(shown))
        return
    if (scene.frame_start, scene.frame_end) != (1, len(plan)):
        scene.frame_start, scene.frame_end = 1, len(plan)
    place = min(max(scene.frame_current - 1, 0), len(plan) - 1)
    turntable.show(scene, tuple(plan.angles_deg[place].tolist()))


def let_go(scene: bpy.types.Scene) -> None:
    """The scene stands as its user made it."""
    from . import turntable

    turntable.let_go(scene)


def save_copy(scene: bpy.types.Scene) -> None:
    """Write the file as it stands, without anything of ours, to where the host reads it.

    Raises HeadturnError: it cannot be written.
    """
    from generator.errors import DatasetError

    from . import turntable

    target = copy_of(scene.headturn)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with session.quiet(), turntable.lifted(scene):
            bpy.ops.wm.save_as_mainfile(filepath=str(target), copy=True, check_existing=False)
    except (OSError, RuntimeError) as error:
        raise DatasetError(f"{target}: cannot be written ({' '.join(str(error).split())})") from error


def copy_of(shown: Shown) -> Path:
    """Where the copy of the file goes: beside the folder of the dataset, under the file's own name."""
    out = Path(settings.absolute(shown.out))
    stem = Path(bpy.data.filepath).stem if bpy.data.filepath else "scene"
    return out.with_name(f"{out.name}-scene") / f"{stem}.blend"


@bpy.app.handlers.persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    if not own.is_own(scene) and any(own.is_own(one) for one in scene.collection.children):
        follow(scene)


_register, _unregister = registering(UseSelected, BuildSelected, LetGo, SelectedPanel)


def register() -> None:
    """Add buttons and panel, and follow the timeline."""
    _register()
    bpy.app.handlers.frame_change_pre.append(_on_frame)


def unregister() -> None:
    """Take them away."""
    bpy.app.handlers.frame_change_pre.remove(_on_frame)
    _unregister()

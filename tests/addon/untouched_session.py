# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a bpy wheel: what is the user's stays his. argv: extension zip, head, folder."""

from __future__ import annotations

import importlib
import shutil
import sys
from pathlib import Path

import bpy
import numpy as np
from whole_file import differences, whole_file

NAME = "bl_ext.user_default.headturn"


def module(name: str):
    """A module of the extension."""
    return importlib.import_module(f"{NAME}.{name}")


def same(before: dict, after: dict, but: tuple[str, ...] = ()) -> None:
    """Nothing differs, but for paths that start so."""
    left = [line for line in differences(before, after) if not line.startswith(but)]
    assert not left, "\n".join(left[:20])


def of_the_users(before: dict) -> dict:
    """The same things as they are now; the views belong to the studio as long as it is shown."""
    now = whole_file()
    assert set(before) <= set(now), set(before) - set(now)
    return {name: now[name] for name in before if not name.startswith("screens/")}


def without_screens(said: dict) -> dict:
    """All but the views."""
    return {name: value for name, value in said.items() if not name.startswith("screens/")}


def setting_up() -> bpy.types.Scene:
    """A scene of the user's that has every name that we would like."""
    mine = bpy.context.scene
    mine.name = "Headturn of mine"
    mine.render.engine, mine.view_settings.view_transform = "BLENDER_WORKBENCH", "Filmic"
    mine.frame_start, mine.frame_end, mine.frame_current = 10, 77, 33
    mine.cycles.samples = 77
    for name in ("head", "camera", "key"):
        mine.collection.objects.link(bpy.data.objects.new(name, None))
    mine.collection.children.link(bpy.data.collections.new("Headturn"))
    bpy.data.texts.new("Headturn report").write("mine")
    bpy.data.images.new("Headturn extremes", 4, 4).use_fake_user = True
    for kept in (bpy.data.materials.new("skin"), bpy.data.worlds.new("surroundings")):
        kept.use_fake_user = True
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            shading = area.spaces.active.shading
            shading.type, shading.light, shading.color_type = "SOLID", "MATCAP", "OBJECT"
            shading.background_type, shading.background_color = "VIEWPORT", (0.1, 0.2, 0.3)
    return mine


def main(package: str, head: str, folder: str) -> None:
    importlib.import_module("addon_utils")
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    mine = setting_up()
    shown = mine.headturn
    # Somebody uses the head's texture for something of his own.
    mesh = module("generator.heads.package").load_package(Path(head))
    for texture in {material.texture for material in mesh.materials if material.texture}:
        bpy.data.images.load(str(texture)).use_fake_user = True
    before = whole_file()

    # Without a head, nothing in the panel does anything to the file.
    for name, value in {"viewport": "RENDERED", "yaw": 20.0, "snap": True, "on_timeline": True}.items():
        setattr(shown, name, value)
        same(before, whole_file())
    shown.poses_yaw, shown.render_preset, shown.show_landmarks = (-30, 30, 30), "quality", True
    shown.on_timeline, shown.viewport = False, "SOLID"
    assert bpy.ops.headturn.reset_pose() == {"FINISHED"}
    same(before, whole_file())

    bad = Path(folder) / "unknown.toml"
    check_config(bad, mine)
    same(before, whole_file())

    studio, own, keys = (module(name) for name in ("studio", "own", "keys"))
    scene = studio.studio_scene(mine)
    assert scene != mine and bpy.context.window_manager.windows[0].scene == scene
    studio.show_package(scene, Path(head), 120.0, placed(keys, scene.headturn))
    same(without_screens(before), of_the_users(before))
    made = [thing.name for thing in own.things(scene)]
    assert len(made) == len(scene.objects) == 3, made
    check_hat(mine, scene)
    check_config(bad, scene)
    same(without_screens(before), of_the_users(before))
    check_found(scene, Path(head), Path(folder))
    same(without_screens(before), of_the_users(before))
    check_pose(scene)
    check_timeline(scene)
    same(without_screens(before), of_the_users(before))

    # Reports and pictures of ours are ours, whoever has their names.
    building, windows = module("building"), module("windows")
    building.current.report = "a report"
    image = Path(folder) / "sheet.png"
    save_picture(image)
    windows.keep_image("Headturn extremes", str(image))
    own.keep(bpy.data.texts.new("Headturn report"), "Headturn report")
    assert building.report().as_string() != "mine"
    same(without_screens(before), of_the_users(before))

    # And back, twice: the same studio is there again, with the settings that it had.
    scene.headturn.render_lens_mm = 60
    for _ in range(2):
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], scene=scene):
            assert bpy.ops.headturn.leave() == {"FINISHED"}
        assert bpy.context.window_manager.windows[0].scene == mine
        added = tuple(f"/{name}:" for name in set(whole_file()) - set(before))
        same(before, whole_file(), added)
        assert shown.render_lens_mm == 60
        assert studio.studio_scene(mine) == scene and scene.headturn.head is not None
        studio.show_views(scene.headturn)

    assert bpy.ops.headturn.remove() == {"FINISHED"}
    same(before, whole_file())
    assert not own.scenes() and shown.render_lens_mm == 85 and not shown.is_property_set("render_lens_mm")

    # What is the user's keeps the scene that it stands in.
    scene = studio.studio_scene(mine)
    studio.show_package(scene, Path(head), 120.0)
    for place in (scene.collection, scene.collection.children[0]):
        hat = bpy.data.objects.new("hat", None)
        place.objects.link(hat)
    assert bpy.ops.headturn.remove() == {"FINISHED"}
    assert [thing.name[:3] for thing in scene.objects] == ["hat", "hat"] and not own.is_own(scene)
    for one in (*scene.objects, *scene.collection.children):
        bpy.data.batch_remove([one])
    bpy.data.scenes.remove(scene)
    same(before, whole_file())
    print("passed", bpy.app.version_string)


def placed(keys, shown, head=("anna", "neutral")) -> str:
    """What the host would say of a head."""
    source = keys.source(module("settings").to_config(shown))
    return module("core.found").Placed(head, source, 9, ["a note"]).text()


def check_config(bad: Path, scene: bpy.types.Scene) -> None:
    """A file that is no configuration is refused in one line, and changes nothing."""
    settings = module("settings")
    config, file = settings.to_config(scene.headturn), whole_file()
    for text, said in {
        "[render]\nresolutoin = 64": "render.resolutoin: no such setting; there is resolution",
        "[poses]\nyaw = 3": "poses.yaw: the panel cannot show 3",
        "[render]\nsamples = 0.5": "samples",
    }.items():
        bad.write_text(text)
        with bpy.context.temp_override(scene=scene):
            try:
                bpy.ops.headturn.load_config(filepath=str(bad))
            except RuntimeError as error:
                line = str(error).strip()
            else:
                raise AssertionError(f"{text} was taken")
        assert said in line and "\n" not in line and "Traceback" not in line, line
        assert settings.to_config(scene.headturn) == config, text
        same(file, whole_file())


def check_hat(mine: bpy.types.Scene, scene: bpy.types.Scene) -> None:
    """Things of the user's in the studio outlast every edit, in both scenes, and hang on the head."""
    shown, lamp = scene.headturn, bpy.data.objects["Light"]
    scene.collection.objects.link(lamp)
    hat = bpy.data.objects.new("hat", bpy.data.meshes["Cube"])
    scene.collection.objects.link(hat)
    hat.parent = shown.head
    # What somebody moves into our own collection is his, too.
    cap, [place] = bpy.data.objects.new("cap", None), scene.collection.children
    place.objects.link(cap)
    lamp_before = whole_file(("lights",))["lights/Light"]
    shown.yaw, shown.render_light_yaw_deg, shown.render_ambient = 20, 5, 0.3
    made = shown.head.as_pointer()
    for preset in ("fast", "quality", "fast"):
        shown.render_preset = preset
    shown.render_samples_unset, shown.render_samples = False, 9
    assert shown.head.as_pointer() != made, "a stage was built"
    assert hat.parent == shown.head and not hat.hide_select and not lamp.hide_select
    assert lamp.name in scene.objects and lamp.name in mine.objects and hat.name in scene.objects
    assert cap.name in place.objects and not cap.hide_select
    same(lamp_before, whole_file(("lights",))["lights/Light"])
    assert sum(thing.type == "MESH" for thing in scene.objects) == 2
    shown.property_unset("render_samples_unset")
    shown.property_unset("render_samples")
    scene.collection.objects.unlink(lamp)
    bpy.data.objects.remove(hat)
    bpy.data.objects.remove(cap)


def check_found(scene: bpy.types.Scene, head: Path, folder: Path) -> None:
    """What was found counts for its head, pose and look."""
    keys, studio, own, state = module("keys"), module("studio"), module("own"), module("session").state
    found, shown = module("core.found"), scene.headturn
    points = found.Points([[1.0, 2.0]] * 468)
    state.landmarks.take(keys.at_pose(shown), points)
    state.extremes.take(keys.of_plan(shown), "A face was found in 9 of 9")
    listing = found.Listing([("anna", "neutral")], [])
    state.lists.take(keys.source(module("settings").to_config(shown)), listing)

    def there() -> tuple[bool, bool, bool]:
        return (
            keys.landmarks(shown) is points,
            keys.extremes(shown) != "",
            keys.listing(shown) is listing,
        )

    assert there() == (True, True, True)
    for name, value, left in (
        ("yaw", 11.0, (False, True, True)),
        ("render_lens_mm", 40.0, (False, False, True)),
        ("poses_yaw", (-10, 10, 10), (True, False, True)),
        ("landmarks_min_confidence", 0.9, (False, False, True)),
        ("heads_seed", 5, (True, True, False)),
    ):
        was = getattr(shown, name)
        was = tuple(was) if name == "poses_yaw" else was
        setattr(shown, name, value)
        assert there() == left, (name, there())
        setattr(shown, name, was)
        assert there() == (True, True, True), name

    assert keys.placed(shown).head == ("anna", "neutral") and keys.viewed(shown) == ("anna", "neutral")
    other = folder / "other.npz"
    shutil.copy(head, other)
    studio.show_package(scene, other, 120.0, placed(keys, shown, ("bert", "neutral")))
    assert there() == (False, False, True) and keys.placed(shown).head == ("bert", "neutral")
    try:
        studio.show_package(scene, folder / "gone.npz", 99.0, placed(keys, shown))
    except Exception as error:
        assert "gone.npz" in str(error), error
    assert keys.placed(shown).head == ("bert", "neutral") and own.head(shown) is not None
    bpy.data.objects.remove(shown.head)
    assert not bpy.ops.headturn.preview_extremes.poll()
    studio.show_package(scene, head, 120.0, placed(keys, shown))
    assert there() == (True, True, True)

    # A head that somebody deletes goes with all that is said of it; the property alone would keep it.
    for place in shown.head.users_collection:
        place.objects.unlink(shown.head)
    assert shown.head is not None and own.head(shown) is None and keys.placed(shown) is None
    assert there() == (False, False, True) and not bpy.ops.headturn.look.poll()
    shown.yaw, shown.render_lens_mm = 3, 85
    studio.show_package(scene, head, 120.0, placed(keys, shown))
    assert own.head(shown) is not None


def turned(shown) -> float:
    """The yaw of the head itself, degrees."""
    return float(np.degrees(np.arctan2(shown.head.matrix_world[1][0], shown.head.matrix_world[0][0])))


def check_pose(scene: bpy.types.Scene) -> None:
    """Pose follows its properties however they change: keyframes and drivers call no update function."""
    shown = scene.headturn
    shown.snap = False
    shown.yaw, shown.pitch, shown.roll = 0, 0, 0
    for frame, yaw in ((1, 0.0), (11, 40.0)):
        shown.yaw = yaw
        scene.keyframe_insert("headturn.yaw", frame=frame)
    for frame in (1, 6, 11, 6):
        scene.frame_set(frame)
        assert abs(abs(turned(shown)) - shown.yaw) < 1e-3, (frame, shown.yaw, turned(shown))
    assert 10 < shown.yaw < 30
    action = scene.animation_data.action
    scene.animation_data_clear()
    bpy.data.actions.remove(action)
    driver = scene.driver_add("headturn.yaw").driver
    driver.expression = "frame * 2"
    scene.frame_set(7)
    assert shown.yaw == 14 and abs(abs(turned(shown)) - 14) < 1e-3, (shown.yaw, turned(shown))
    scene.driver_remove("headturn.yaw")
    scene.animation_data_clear()


def check_timeline(scene: bpy.types.Scene) -> None:
    """The frame range is as it was before the plan lay on it."""
    shown = scene.headturn
    scene.frame_start, scene.frame_end = 3, 44
    scene.frame_set(9)
    shown.on_timeline = True
    shown.poses_pitch = (-20, 20, 20)
    assert (scene.frame_start, scene.frame_end) != (3, 44)
    scene.frame_set(2)
    shown.on_timeline = False
    assert (scene.frame_start, scene.frame_end, scene.frame_current) == (3, 44, 9)


def save_picture(path: Path) -> None:
    """Some picture."""
    image = bpy.data.images.new("some", 2, 2)
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


main(*sys.argv[1:])

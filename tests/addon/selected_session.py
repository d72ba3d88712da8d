# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a bpy wheel: the head in the user's own scene turns, and stands as it stood. argv: zip, folder"""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector
from whole_file import differences, whole_file

NAME = "bl_ext.user_default.headturn"
PLACE = Matrix.Translation((2.0, 3.0, 1.0)) @ Euler((1.5, 0.1, 0.4)).to_matrix().to_4x4()


def module(name: str):
    """A module of the extension."""
    return importlib.import_module(f"{NAME}.{name}")


def same(before: dict) -> None:
    left = differences(before, whole_file())
    assert not left, "\n".join(left[:20])


def setting_up() -> tuple[bpy.types.Scene, bpy.types.Object]:
    """A head with an eye, that hangs on something and is held by something."""
    mine = bpy.context.scene
    mine.frame_start, mine.frame_end, mine.frame_current = 10, 77, 33
    made = {name: bpy.data.objects.new(name, bpy.data.meshes["Cube"]) for name in ("Body", "Head", "Eye")}
    for one in made.values():
        mine.collection.objects.link(one)
    made["Body"].matrix_world = PLACE
    made["Head"].parent, made["Eye"].parent = made["Body"], made["Head"]
    made["Head"].location, made["Eye"].location = (0, 0, 0.2), (0, 0.1, 0)
    made["Head"].constraints.new("LIMIT_ROTATION")
    bpy.context.view_layer.update()
    return mine, made["Head"]


def package(folder: Path, head: bpy.types.Object) -> Path:
    """What the host would write of the head: its pivot is 10 cm above its origin."""
    heads = {name: module(f"generator.heads.{name}") for name in ("mesh", "scene", "package")}
    world = head.matrix_world.copy()
    world.translation = world @ Vector((0, 0, 0.1))
    scale = Matrix.Scale(1e-3, 4)
    numbers = tuple(float(value) for row in world @ scale for value in row)
    scene = heads["scene"].BlendScene("a.blend", "Head", "", numbers, None, (), "the scene has no camera")
    mesh = heads["mesh"].HeadMesh(
        np.eye(3), np.array([[0, 1, 2]], np.int32), None, None, np.zeros(1, np.int32),
        (heads["mesh"].Material("skin"),), scene=scene,
    )  # fmt: skip
    heads["package"].save_package(mesh, folder / "head.npz")
    return folder / "head.npz"


def main(extension: str, folder: str) -> None:
    importlib.import_module("addon_utils")
    bpy.ops.extensions.package_install_files(filepath=extension, repo="user_default", enable_on_install=True)
    mine, head = setting_up()
    shown, selected, turntable = mine.headturn, module("selected"), module("turntable")
    before, stood = whole_file(), head.matrix_world.copy()
    assert not bpy.ops.headturn.use_selected.poll(), "no folder of the dataset is chosen"
    assert not bpy.ops.headturn.let_go.poll() and not bpy.ops.headturn.build_selected.poll()
    shown.out = str(Path(folder) / "dataset")

    file = package(Path(folder), head)
    selected.placed(mine, "Head", file, scene_camera=False)
    assert (mine.frame_start, mine.frame_end) == (1, 693)
    table = turntable.find(mine)
    pivot = stood @ Vector((0, 0, 0.1))
    assert (table.matrix_world.translation - pivot).length < 1e-5

    # Frame k shows pose k, about the pivot, in the head's own axes, and the eye goes along.
    rotation = module("generator.geometry.rotation")
    plan = module("core.grid").plan_poses(module("settings").poses(shown), ("scene", "neutral"))
    for frame in (1, 347, 693):
        mine.frame_set(frame)
        bpy.context.view_layer.update()
        turn = rotation.graphics_rotation(rotation.rotation_from_angles(plan.angles_deg[frame - 1]))
        expected = stood @ Matrix.Translation((0, 0, 0.1)) @ Matrix(turn.tolist()).to_4x4()
        expected = expected @ Matrix.Translation((0, 0, -0.1))
        far = max(
            abs(a - b)
            for x, y in zip(expected, head.matrix_world, strict=True)
            for a, b in zip(x, y, strict=True)
        )
        assert far < 1e-5, (frame, far)
        eye = bpy.data.objects["Eye"].matrix_world.translation
        assert (eye - expected @ Vector((0, 0.1, 0))).length < 1e-5

    # What is saved for the host is the scene as the user made it, and the preview stays as it was.
    selected.save_copy(mine)
    copy = selected.copy_of(shown)
    assert copy == Path(folder) / "dataset-scene" / "scene.blend" and copy.stat().st_size
    assert mine.frame_current == 693 and (mine.frame_start, mine.frame_end) == (1, 693)
    assert turntable.find(mine) == table and len(head.constraints) == 2

    # The scene has no camera that can be used.
    try:
        selected.placed(mine, "Head", file, scene_camera=True)
    except ValueError as error:
        assert str(error) == "the scene has no camera"
    else:
        raise AssertionError("another camera was taken")

    for way in ("let_go", "remove"):
        selected.placed(mine, "Head", file, scene_camera=False)
        now = whole_file(("objects",))
        users = {name: now[name] for name in before if name.startswith("objects/")}
        there = {name: said for name, said in before.items() if name in users}
        changed = [line for line in differences(there, users) if "matrix" not in line]
        changed = [line for line in changed if not line.startswith("/objects/Head/constraints")]
        assert not changed and len(head.constraints) == 2, changed
        assert getattr(bpy.ops.headturn, way)() == {"FINISHED"}
        same(before)
        bpy.context.view_layer.update()
        assert (head.matrix_world.translation - stood.translation).length < 1e-6
    check_copy(copy)
    print("passed", bpy.app.version_string)
    sys.stdout.flush()
    os._exit(0)


def check_copy(copy: Path) -> None:
    """Nothing of ours is in it but the settings."""
    bpy.ops.wm.open_mainfile(filepath=str(copy))
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end, scene.frame_current) == (10, 77, 33)
    assert [one.type for one in bpy.data.objects["Head"].constraints] == ["LIMIT_ROTATION"]
    expected = PLACE @ Vector((0, 0, 0.2))
    assert (bpy.data.objects["Head"].matrix_world.translation - expected).length < 1e-5


if __name__ == "__main__":
    main(*sys.argv[1:])

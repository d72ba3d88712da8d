# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of every kind, and what is said of each, in one process: ``python many_scenes.py FOLDER``.

FOLDER/said.json has an answer of generator.blender.describe a scene, FOLDER/turned.json what frozen_scenes.py
says, FOLDER/hair.json what haired_scenes.py does, FOLDER/looks.json, order.json and through.json what
rendered_scenes.py does; FOLDER/cameras.json has Blender's own projection
matrices of some cameras.
"""

from __future__ import annotations

import itertools
import json
import os
import sys
from pathlib import Path

import bpy
from frozen_scenes import how_they_turn
from haired_scenes import how_hair_is_seen
from rendered_scenes import how_they_look, what_one_sees_through, whether_order_matters

from generator.blender import outside
from generator.blender.describe import main as describe

FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
SIZES = ((160, 120), (120, 160), (100, 100))


def thing(name: str, parent: bpy.types.Object | None = None, faces: bool = True) -> bpy.types.Object:
    data = None
    if faces:
        data = bpy.data.meshes.new(name)
        data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [], [(0, 1, 2)])
    made = bpy.data.objects.new(name, data)
    made.parent = parent
    bpy.context.scene.collection.objects.link(made)
    return made


def two() -> None:
    thing("Anna"), thing("Floor")


def tagged() -> None:
    two()
    bpy.data.objects["Anna"]["headturn_head"] = True


def both_tagged() -> None:
    tagged()
    bpy.data.objects["Floor"]["headturn_head"] = 1


def alone() -> None:
    eye = thing("Eye", thing("Rig", faces=False))
    thing("Hidden").hide_render = True
    eye.shape_key_add(name="Basis")
    for name in ("smile", "a/b", "a:b", "neutral", "off"):
        eye.shape_key_add(name=name)
    eye.data.shape_keys.key_blocks["off"].mute = True


def left_out() -> None:
    """Others are in a collection that the view layer leaves out, and in one that is not rendered."""
    thing("Anna")
    for name in ("Excluded", "Unrendered"):
        made = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(made)
        other = thing(f"{name} head")
        bpy.context.scene.collection.objects.unlink(other)
        made.objects.link(other)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True
    bpy.data.collections["Unrendered"].hide_render = True


def collection() -> None:
    two()
    made = bpy.data.collections.new("Head")
    bpy.context.scene.collection.children.link(made)
    made.objects.link(thing("Teeth"))


def empty() -> None:
    thing("Nothing", faces=False)


def textured() -> None:
    alone()
    image = bpy.data.images.new("skin", 4, 4)
    image.source, image.filepath, image.use_fake_user = "FILE", "//away/skin.png", True


CASES = {
    "two": (two, ""),
    "two-named": (two, "Floor"),
    "two-misnamed": (two, "Bob"),
    "tagged": (tagged, ""),
    "both-tagged": (both_tagged, ""),
    "alone": (alone, ""),
    "collection": (collection, "Head"),
    "empty": (empty, ""),
    "left out": (left_out, ""),
    "textured": (textured, ""),
}


def scattered(folder: Path) -> Path:
    """A scene with files of every kind in other folders, and with what no picture shows."""
    alone()
    textures = folder / "textures"
    for name in ("skin", "walk_09", "walk_10", "walk", "hat.1001", "hat.1002", "in"):
        picture(textures / f"{name}.png")
    for name in ("smoke.vdb", "read me.txt", "breath.wav", "lamp.ies"):
        (textures / name).write_bytes(b"x")
    for name, source in {"skin.png": "FILE", "walk_09.png": "SEQUENCE", "hat.<UDIM>.png": "TILED"}.items():
        image = bpy.data.images.new(name, 4, 4)
        image.source, image.filepath, image.use_fake_user = source, str(textures / name), True
    bpy.data.images.load(str(textures / "in.png")).pack()
    bpy.data.images["in.png"].use_fake_user = True
    smoke = bpy.data.volumes.new("smoke")
    smoke.filepath, smoke.use_fake_user = str(textures / "smoke.vdb"), True
    lost = bpy.data.volumes.new("lost")
    lost.filepath, lost.use_fake_user = str(textures / "lost.vdb"), True
    bpy.data.texts.load(str(textures / "read me.txt"))
    bpy.data.sounds.load(str(textures / "breath.wav")).use_fake_user = True
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.use_nodes = lamp.use_fake_user = True
    shape = lamp.node_tree.nodes.new("ShaderNodeTexIES")
    shape.mode, shape.filepath = "EXTERNAL", str(textures / "lamp.ies")
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Eye"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    file = folder / "scenes" / "scattered.blend"
    cloth = file.with_name("blendcache_scattered") / "cloth_000001_00.bphys"
    cloth.parent.mkdir(parents=True)
    cloth.write_bytes(b"x")
    bpy.ops.wm.save_as_mainfile(filepath=str(file), relative_remap=True)
    return file


def picture(file: Path) -> None:
    """Some image file."""
    made = bpy.data.images.new("made", 4, 4)
    made.filepath_raw, made.file_format = str(file), "PNG"
    made.save()
    bpy.data.images.remove(made)


def cameras() -> list[dict]:
    """Blender's own projection of each kind of sensor, shape and pixel."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    lens = bpy.data.cameras.new("lens")
    made = bpy.data.objects.new("lens", lens)
    bpy.context.scene.collection.objects.link(made)
    lens.lens, lens.sensor_width, lens.sensor_height = 70.0, 30.0, 20.0
    lens.shift_x, lens.shift_y = 0.1, -0.07
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for fit, (width, height), aspect in itertools.product(range(3), SIZES, (0.8, 1.0, 1.25)):
        lens.sensor_fit = FITS[fit]
        graph.update()
        matrix = made.calc_matrix_camera(graph, x=width, y=height, scale_x=1.0, scale_y=aspect)
        rows = [list(row) for row in matrix]
        found.append({"fit": fit, "width": width, "height": height, "aspect": aspect, "matrix": rows})
    return found


def main(folder: Path) -> None:
    said = {}
    for name, (make, head_object) in CASES.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        make()
        file = folder / f"{name}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(file))
        said[name] = answer(file, head_object)
    plain = (folder / "alone.blend").read_bytes()
    start = plain.index(b"-v4") + 2
    for name, data in {
        "newer": plain[:start] + b"989" + plain[start + 3 :],
        "cut-off": plain[: len(plain) // 2],
        "text": b"BLENDER, as it says",
    }.items():
        (folder / f"{name}.blend").write_bytes(data)
        said[name] = answer(folder / f"{name}.blend", "")
    (folder / "turned.json").write_text(json.dumps(how_they_turn(folder)))
    (folder / "hair.json").write_text(json.dumps(how_hair_is_seen(folder)))
    (folder / "looks.json").write_text(json.dumps(how_they_look(folder)))
    (folder / "order.json").write_text(json.dumps(whether_order_matters(folder)))
    (folder / "through.json").write_text(json.dumps(what_one_sees_through(folder)))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    file = scattered(folder)
    said["scattered"] = answer(file, "Rig")
    outside.MOST = 8
    said["too many"] = answer(file, "Rig")
    (folder / "said.json").write_text(json.dumps(said))
    (folder / "cameras.json").write_text(json.dumps(cameras()))


def answer(file: Path, head_object: str) -> dict:
    target = file.with_suffix(".json")
    describe(str(file), str(target), head_object)
    return json.loads(target.read_text())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)  # Blender may never come to an end by itself

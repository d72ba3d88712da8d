# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender scene with a head in it, for tests: ``python make_scene.py HEAD.npz SCENE.blend MARK``.

HEAD.npz: vertices (mm, +Y up, +Z forward), triangles and colors. MARK: a file that a script in the scene
would write, did it run. What is worked out of it by hand stands in ``scene_by_hand.py``.
"""

from __future__ import annotations

import math
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

WORLD = (
    Matrix.Translation((0.3, -0.2, 1.5))
    @ Matrix.Rotation(math.radians(30), 4, "Z")
    @ Matrix.Rotation(math.radians(90), 4, "X")
    @ Matrix.Scale(0.01, 4)
)
"""Of the face, whose mesh is in cm."""


def main(head: str, file: str, mark: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    face = _face(np.load(head))
    hair = _hair(face)
    glasses = _glasses(face)
    for thing in (hair, glasses):
        thing.parent = face
    _wall(scene)
    _post(scene)
    _camera(scene)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
    lamp.data.energy = 3.0
    lamp.matrix_world = Matrix.Rotation(math.radians(40), 4, "X")
    scene.collection.objects.link(lamp)
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.3, 0.4, 0.6, 1)
    _traps(lamp, mark)
    bpy.ops.wm.save_as_mainfile(filepath=file, compress=True)


def _face(data) -> bpy.types.Object:
    made = bpy.data.meshes.new("Face")
    made.from_pydata((data["vertices"] / 10).tolist(), [], data["triangles"].tolist())
    made.polygons.foreach_set("use_smooth", np.ones(len(made.polygons), dtype=bool))
    colors = made.color_attributes.new("Skin", "BYTE_COLOR", "POINT")
    colors.data.foreach_set("color_srgb", data["colors"].astype(np.float32).ravel())
    material = bpy.data.materials.new("Skin")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    attribute = nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = "Skin"
    shader = nodes["Principled BSDF"]
    material.node_tree.links.new(attribute.outputs[0], shader.inputs["Base Color"])
    made.materials.append(material)
    face = bpy.data.objects.new("Face", made)
    bpy.context.scene.collection.objects.link(face)
    face.matrix_world = WORLD
    face["headturn_head"] = True
    face.shape_key_add(name="Basis")
    smile = face.shape_key_add(name="smile")
    points = np.array([v.co for v in made.vertices])
    smile.data.foreach_set(
        "co", (points + np.array([0.0, 0.3, 0.0]) * _low(points)).astype(np.float32).ravel()
    )
    _rig(face, points)
    # What is seen in the viewport is not what is rendered.
    face.modifiers.new("Off", "DISPLACE").strength = 5.0
    face.modifiers["Off"].show_render = False
    return face


def _low(points: np.ndarray) -> np.ndarray:
    """1 below the ears, else 0, float [V, 1]."""
    low, high = points[:, 1].min(), points[:, 1].max()
    return (points[:, 1:2] < low + 0.45 * (high - low)).astype(np.float64)


def _rig(face: bpy.types.Object, points: np.ndarray) -> None:
    """A jaw that hangs on a bone of an armature that is no parent of the face, turned by 4 degrees."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    rig.matrix_world = WORLD
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new("jaw")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 5)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.pose.bones["jaw"].rotation_mode = "XYZ"
    rig.pose.bones["jaw"].rotation_euler = (math.radians(4), 0, 0)
    group = face.vertex_groups.new(name="jaw")
    group.add(np.flatnonzero(_low(points)[:, 0]).tolist(), 1.0, "REPLACE")
    face.modifiers.new("Rig", "ARMATURE").object = rig


def _hair(face: bpy.types.Object) -> bpy.types.Object:
    """Strands from the crown upwards and backwards."""
    top = sorted((v.co.copy() for v in face.data.vertices), key=lambda co: -co.y)[:400:4]
    data = bpy.data.hair_curves.new("Hair")
    data.add_curves([4] * len(top))
    points = np.array([co + Vector((0, 1.0, -0.6)) * k for co in top for k in range(4)], dtype=np.float32)
    data.position_data.foreach_set("vector", points.ravel())
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(len(points), 0.08, dtype=np.float32))
    material = bpy.data.materials.new("Hair")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.1, 0.04, 0.02, 1)
    data.materials.append(material)
    hair = bpy.data.objects.new("Hair", data)
    bpy.context.scene.collection.objects.link(hair)
    return hair


def _glasses(face: bpy.types.Object) -> bpy.types.Object:
    """A pane before the face that one sees through."""
    front = max(v.co.z for v in face.data.vertices) + 1
    corners = [(-6, -3, front), (6, -3, front), (6, 6, front), (-6, 6, front)]
    made = bpy.data.meshes.new("Pane")
    made.from_pydata(corners, [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Glass")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.remove(nodes["Principled BSDF"])
    clear = nodes.new("ShaderNodeBsdfTransparent")
    material.node_tree.links.new(clear.outputs[0], nodes["Material Output"].inputs[0])
    made.materials.append(material)
    glasses = bpy.data.objects.new("Glasses", made)
    bpy.context.scene.collection.objects.link(glasses)
    return glasses


def _wall(scene: bpy.types.Scene) -> None:
    made = bpy.data.meshes.new("Wall")
    made.from_pydata([(-2, 1, 0), (2, 1, 0), (2, 1, 3), (-2, 1, 3)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Wall")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.5, 0.15, 0.1, 1)
    made.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Wall", made))


def _post(scene: bpy.types.Scene) -> None:
    """Between the camera and the face."""
    corners = [(0.41 + x, -0.9, z) for x, z in ((-0.01, 1), (0.01, 1), (0.01, 2), (-0.01, 2))]
    made = bpy.data.meshes.new("Post")
    made.from_pydata(corners, [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("Post", made))


def _camera(scene: bpy.types.Scene) -> None:
    lens = bpy.data.cameras.new("Camera")
    lens.lens, lens.sensor_fit, lens.sensor_width, lens.sensor_height = 70.0, "VERTICAL", 30.0, 20.0
    lens.shift_x, lens.shift_y = 0.1, -0.07
    camera = bpy.data.objects.new("Camera", lens)
    camera.matrix_world = (
        Matrix.Translation((0.5, -1.6, 1.62))
        @ Matrix.Rotation(math.radians(10), 4, "Z")
        @ Matrix.Rotation(math.radians(86), 4, "X")
        @ Matrix.Rotation(math.radians(5), 4, "Z")
    )
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.25


def _traps(lamp: bpy.types.Object, mark: str) -> None:
    """A text that runs when the file is opened, and a driver that does when it is looked at."""
    code = f"open({mark!r}, 'a').write('ran')"
    text = bpy.data.texts.new("startup.py")
    text.write(f"{code}\n")
    text.use_module = True
    driver = lamp.data.driver_add("energy").driver
    driver.expression = f"__import__('os').system('echo ran >> {mark}') or 3.0"


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender may never come to an end by itself

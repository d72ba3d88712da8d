# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as Blender renders them, and as they are with their head frozen. For many_scenes.py."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from generator.blender.scene_head import SceneHead
from generator.blender.scene_images import SceneImages
from generator.blender.scene_mesh import ALL, CUT, SEEN, joined, placed_surfaces, unknown_shading
from generator.blender.still import render_still
from generator.heads.scene import BlendScene

SIDE = 24


def how_they_look(folder: Path) -> dict[str, dict[str, Any]]:
    """Of each scene: off, how far a pixel is from Blender's own picture at most; shown, how bright it is."""
    makes = animated, cards_of_hair, instances_of_hair, children_on_vertices, metaball
    return {make.__name__: _looks(make, folder) for make in makes}


def what_one_sees_through(folder: Path) -> dict[str, dict[str, Any]]:
    """Of a pane of each material, and on the ways that a scene has to hide a pane: what is said of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    said = {}
    for name, make in PANES.items():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        head = _thing("Head")
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        head.data.materials.append(material)
        make(head, material)
        bpy.context.view_layer.update()
        surfaces = placed_surfaces({head})
        found = {part: joined(surfaces, folder, part) for part in (SEEN, CUT, ALL)}
        said[name] = {
            "parts": [part for part, mesh in found.items() if mesh is not None],
            "cutout": any(one.cutout for mesh in found.values() if mesh for one in mesh.materials),
            "unknown": bool(unknown_shading(surfaces)),
        }
    return said


def whether_order_matters(folder: Path) -> dict[str, float]:
    """A head with hair of particles, seen after another pose and by itself; as of how_they_look."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    head = _thing("Head")
    head.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair = head.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.radius_scale = "HAIR", 400, 0.5, 0.02
    _lit(bpy.context.scene)
    file = folder / "order.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    first, last = (_turned_to(file, angles) for angles in ((0.4, -0.9), (-0.9,)))
    return {"off": float(np.abs(first - last).max()), "shown": float(last.mean())}


def _turned_to(file: Path, angles: Sequence[float]) -> np.ndarray:
    images = SceneImages(BlendScene(str(file), "Head", "", tuple(np.eye(4).reshape(-1).tolist())), threads=1)
    camera, scene = images._camera, images._scene
    camera.location, camera.rotation_euler = (0.4, -3.0, 0.4), (np.pi / 2, 0, 0)
    scene.render.image_settings.file_format = "BMP"
    scene.render.filepath = str(file.with_suffix(".bmp"))
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        images._head.turn(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([0.3, 0.7, 0.0]))
        render_still()
    return _pixels(file.with_suffix(".bmp"))


def animated() -> None:
    """A pane that comes before the camera at frame 10."""
    _thing("Head")
    pane = _thing("Pane")
    for frame, x in ((1, 9.0), (10, 0.0)):
        pane.location = (x, -0.5, 0.4)
        pane.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(10)


def cards_of_hair() -> None:
    tree, strands = _haired()
    profile = tree.nodes.new("GeometryNodeCurvePrimitiveLine")
    profile.inputs["End"].default_value = (0.3, 0.0, 0.0)
    cards = tree.nodes.new("GeometryNodeCurveToMesh")
    _chain(tree, strands, cards)
    tree.links.new(profile.outputs[0], cards.inputs[1])


def instances_of_hair() -> None:
    tree, strands = _haired()
    leaf, leaves = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    leaf.inputs["Size"].default_value = (0.2, 0.2, 0.2)
    _chain(tree, strands, leaves)
    tree.links.new(leaf.outputs[0], leaves.inputs["Instance"])


def children_on_vertices() -> None:
    head = _thing("Head")
    head.instance_type = "VERTS"
    leaf = _thing("Leaf")
    leaf.parent, leaf.scale = head, (0.3, 0.3, 0.3)


def metaball() -> None:
    data = bpy.data.metaballs.new("Nose")
    data.resolution, data.render_resolution = 0.8, 0.2
    data.elements.new().radius = 0.6
    nose = bpy.data.objects.new("Nose", data)
    nose.parent = _thing("Head")
    bpy.context.scene.collection.objects.link(nose)


def _looks(make: Callable[[], None], folder: Path) -> dict[str, Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    make()
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 3.0
    scene.camera.location, scene.camera.rotation_euler = (0.4, -5.0, 0.4), (np.pi / 2, 0, 0)
    scene.collection.objects.link(scene.camera)
    _lit(scene)
    file = folder / f"looks_{make.__name__}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.context.scene.render.filepath = str(file.with_suffix(".bmp"))
    bpy.ops.render.render(write_still=True)
    own = _pixels(file.with_suffix(".bmp"))
    head = SceneHead(file, "Head")
    head.turn(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))  # or something of it does not turn
    head.turn(np.eye(3), np.zeros(3))
    head.scene.render.filepath = str(file.with_suffix(".bmp"))
    render_still()
    return {"off": float(np.abs(_pixels(file.with_suffix(".bmp")) - own).max()), "shown": float(own.mean())}


def _lit(scene: bpy.types.Scene) -> None:
    """Lit, and with what a small picture needs."""
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.0, 0.0, 0.0)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
    lamp.rotation_euler = (1.0, 0.3, 0)
    scene.collection.objects.link(lamp)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.file_format = "BMP"


def _pixels(file: Path) -> np.ndarray:
    image = bpy.data.images.load(str(file))
    found = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return found


def _haired() -> tuple[Any, Any]:
    """Strands of a head with nodes: their tree, and what goes into it."""
    data = bpy.data.hair_curves.new("Hair")
    data.add_curves([3])
    data.position_data.foreach_set("vector", [0.2, -0.5, 0.1, 0.3, -0.5, 0.5, 0.2, -0.5, 0.9])
    hair = bpy.data.objects.new("Hair", data)
    hair.parent = _thing("Head")
    bpy.context.scene.collection.objects.link(hair)
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    hair.modifiers.new("Nodes", "NODES").node_group = tree
    return tree, tree.nodes.new("NodeGroupInput")


def _chain(tree: Any, first: Any, then: Any) -> None:
    tree.links.new(first.outputs[0], then.inputs[0])
    tree.links.new(then.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])


def _thing(name: str) -> bpy.types.Object:
    data = bpy.data.meshes.new(name)
    data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [], [(0, 1, 2)])
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def _output(material: bpy.types.Material, kind: str, tree: Any = None) -> Any:
    """A shader of a kind that a material is made of; its first one stays, unlinked."""
    nodes = material.node_tree.nodes
    made = nodes.new(kind)
    if tree is not None:
        made.node_tree = tree
    material.node_tree.links.new(made.outputs[0], nodes["Material Output"].inputs[0])
    return made


def _group(kind: str) -> Any:
    tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    tree.links.new(tree.nodes.new(kind).outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    return tree


def _mix(material: bpy.types.Material, share: str = "", output: str = "") -> None:
    """A twentieth of a Principled shader, or as much of it as a node says, before one that is clear."""
    made = _output(material, "ShaderNodeMixShader")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], made.inputs[1])
    links.new(nodes["Principled BSDF"].outputs[0], made.inputs[2])
    made.inputs[0].default_value = 0.05
    if share:
        node = nodes.new(share)
        if share == "ShaderNodeTexImage":
            node.image = bpy.data.images.new("alpha", 4, 4, alpha=True)
        links.new(node.outputs[output], made.inputs[0])


def _alpha(material: bpy.types.Material) -> None:
    value = material.node_tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 0.0
    material.node_tree.links.new(
        value.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
    )


def _fog(material: bpy.types.Material) -> None:
    nodes = material.node_tree.nodes
    nodes.remove(nodes["Principled BSDF"])
    fog = nodes.new("ShaderNodeVolumeScatter")
    material.node_tree.links.new(fog.outputs[0], nodes["Material Output"].inputs["Volume"])


def _layer(head: bpy.types.Object, **flags: bool) -> None:
    made = bpy.data.collections.new("Layer")
    bpy.context.scene.collection.children.link(made)
    bpy.context.scene.collection.objects.unlink(head)
    made.objects.link(head)
    for name, value in flags.items():
        setattr(bpy.context.view_layer.layer_collection.children["Layer"], name, value)


PANES: dict[str, Callable[[Any, Any], Any]] = {
    "solid": lambda head, material: None,
    "glass": lambda head, material: _output(material, "ShaderNodeBsdfGlass"),
    "clear group": lambda head, material: _output(
        material, "ShaderNodeGroup", _group("ShaderNodeBsdfTransparent")
    ),
    "solid group": lambda head, material: (
        _output(material, "ShaderNodeGroup", _group("ShaderNodeBsdfDiffuse")),
        material.node_tree.nodes.new("ShaderNodeBsdfTransparent"),
    ),
    "nearly clear": lambda head, material: _mix(material),
    "card": lambda head, material: _mix(material, "ShaderNodeTexImage", "Alpha"),
    "one side": lambda head, material: _mix(material, "ShaderNodeNewGeometry", "Backfacing"),
    "no alpha": lambda head, material: _alpha(material),
    "fog": lambda head, material: _fog(material),
    "holdout shader": lambda head, material: _output(material, "ShaderNodeHoldout"),
    "holdout": lambda head, material: setattr(head, "is_holdout", True),
    "holdout layer": lambda head, material: _layer(head, holdout=True),
    "indirect layer": lambda head, material: _layer(head, indirect_only=True),
}

# SPDX-License-Identifier: GPL-3.0-or-later
"""A Collada file that Blender wrote is the scene that Blender writes as glTF."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

EXPORT = """
import bpy, sys
folder = sys.argv[1]
bpy.ops.wm.read_factory_settings(use_empty=True)
if "collada_export" not in dir(bpy.ops.wm):
    sys.exit(77)

def shaded(thing, name, color, alpha=1.0):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = color
    shader.inputs["Alpha"].default_value = alpha
    thing.data.materials.append(material)
    return material.node_tree, shader

bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=0.1, location=(0.3, 0.2, 0.5),
    rotation=(0.3, 0.2, 1.0), scale=(1, 2, 1.5))
tree, shader = shaded(bpy.context.object, "skin", (1, 1, 1, 1))
image = tree.nodes.new("ShaderNodeTexImage")
image.image = bpy.data.images.load(folder + "/skin.png")
tree.links.new(image.outputs["Color"], shader.inputs["Base Color"])
bpy.ops.mesh.primitive_cube_add(size=0.1, location=(1, 0, 0))
cube = bpy.context.object
shaded(cube, "red", (0.5, 0.1, 0.0, 1))
bpy.ops.mesh.primitive_ico_sphere_add(radius=0.2, location=(2, 0, 0))
bpy.context.object.parent = cube
shaded(bpy.context.object, "glass", (1, 1, 1, 1), 0.05)
bpy.ops.wm.collada_export(filepath=folder + "/head.dae")
bpy.ops.export_scene.gltf(filepath=folder + "/other.glb")
"""


def _read(path: Path, scratch: Path) -> HeadMesh:
    scratch.mkdir()
    (head,) = find_heads(path).heads
    return read_mesh(head, scratch)


@pytest.mark.slow
def test_a_scene_is_the_same_as_collada_and_as_gltf(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8), (200, 100, 50)).save(tmp_path / "skin.png")
    command = [sys.executable, "-c", EXPORT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, timeout=120, check=False)
    if done.returncode == 77:
        pytest.skip("this Blender writes no Collada")
    assert done.returncode == 0, done.stderr[-2000:]
    one, other = (_read(tmp_path / name, tmp_path / name[-3:]) for name in ("head.dae", "other.glb"))
    assert len(one.triangles) == len(other.triangles) == 180
    assert any("'glass' is left out" in problem for problem in one.problems)
    by_name = [dict(zip((m.name for m in mesh.materials), range(9), strict=False)) for mesh in (one, other)]
    assert set(by_name[0]) == set(by_name[1]) == {"skin", "red"}
    for name in by_name[0]:
        places = [index[name] for index in by_name]
        materials = [mesh.materials[place] for mesh, place in zip((one, other), places, strict=True)]
        assert materials[0].base_color == pytest.approx(materials[1].base_color, abs=1e-3)
        assert (materials[0].texture is None) == (materials[1].texture is None)
        shapes = []
        for mesh, place in zip((one, other), places, strict=True):
            points = mesh.vertices[mesh.triangles[mesh.material_index == place]]
            assert mesh.uv is not None
            uv = mesh.uv[mesh.material_index == place]
            volume = np.einsum("ti,ti->", points[:, 0], np.cross(points[:, 1], points[:, 2])) / 6
            places_of_vertices = np.unique(points.reshape(-1, 3).round(4), axis=0)
            centre, spread = places_of_vertices.mean(0), places_of_vertices.std(0)
            drawn = uv.mean((0, 1)) if mesh.materials[place].texture else np.zeros(2)
            shapes.append(np.concatenate([[volume * 1000], centre, spread, drawn]))
        np.testing.assert_allclose(shapes[0], shapes[1], atol=2e-4)

# SPDX-License-Identifier: GPL-3.0-or-later
"""The head of a .blend as a package: its surface as rendered, and what is to be known of its scene."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from generator.blender.scene_file import listed
from generator.blender.scene_head import SceneHead
from generator.blender.scene_mesh import ALL, CUT, Surface, joined, placed_surfaces, unknown_shading
from generator.blender.scene_strands import both, strands
from generator.errors import HeadError
from generator.geometry.scene_camera import FITS, SceneCamera
from generator.heads.limits import MAX_TRIANGLES
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.scene import BlendScene, Numbers
from generator.messages import SceneOrder

COARSE = 1e-3
"""Of a head's size, the steps in which Blender places it: more than that is said."""


def read_scene(order: SceneOrder) -> None:
    """Carry out an order. Raises HeadError: the .blend cannot be opened, or has no such head."""
    head = SceneHead(Path(order.source), order.head_object, order.shape_key)
    target = Path(order.target)
    ours = {*head.objects}
    metres = _metres(head.scene)
    world = np.array(head.frame, dtype=np.float64)

    def in_own_axes(mesh: HeadMesh) -> HeadMesh:
        return replace(mesh, vertices=(mesh.vertices - world[:3, 3]) @ world[:3, :3] * metres)

    def beside(name: str, mesh: HeadMesh | None) -> str:
        if mesh is None:
            return ""
        file = target.with_name(name)
        save_package(in_own_axes(mesh), file)
        return str(file)

    surfaces, rest = placed_surfaces(ours), placed_surfaces(ours, others=True)
    head.problems += [*unknown_shading([*surfaces, *rest]), *_unlabelled(ours), *_coarse(surfaces)]
    mesh = joined(surfaces, _folder(target, "scene-textures"))
    if mesh is None:
        raise HeadError("the head has no surface that is rendered and that one cannot see through")
    mesh = in_own_axes(mesh)
    cut = joined(surfaces, _folder(target, "cut-textures"), CUT)
    hair = beside("hair.npz", both(strands(ours), cut))
    behind = beside("rest.npz", _rest(head, rest, _folder(target, "rest-textures")))
    world[:3, :3] /= metres
    to_world = tuple(world.reshape(-1).tolist())
    scene = BlendScene(
        *(order.source, order.head_object, order.shape_key, to_world),
        *_camera(head),
        hair=hair,
        rest=behind,
        clip=_clip(head.scene),
    )
    problems = tuple(head.problems)
    save_package(replace(mesh, scene=scene, problems=problems), target)


def _folder(target: Path, name: str) -> Path:
    made = target.with_name(name)
    made.mkdir(exist_ok=True)
    return made


def _unlabelled(ours: Collection[bpy.types.Object]) -> Iterator[str]:
    """What is rendered and hides no landmark."""
    graph = bpy.context.evaluated_depsgraph_get()
    names: dict[str, None] = {}
    for instance in graph.object_instances:
        here = instance.object
        owner = (instance.parent if instance.is_instance else here).original
        hairy = (here.type == "CURVES" and len(here.data.points)) or here.particle_systems
        if here.visible_camera and (here.type == "POINTCLOUD" or (owner not in ours and hairy)):
            names[owner.name] = None
    if names:
        yield f"{listed(names)}: points, and hair that is not the head's, hide no landmark for labels"


def _coarse(surfaces: Sequence[Surface]) -> Iterator[str]:
    """Far from the world's origin Blender's 32 bits tell no near points apart."""
    points = np.concatenate([one.vertices for one in surfaces] or [np.zeros((1, 3))])
    far = np.abs(points).max()
    step, size = np.spacing(np.float32(far)), np.ptp(points, axis=0).max()
    if step > COARSE * size:
        yield (
            f"it stands {far:.3g} units from the world's origin, where Blender tells points apart by "
            f"{step:.2g}, {100 * step / size:.1g} % of the head; move the scene to the origin"
        )


def _rest(head: SceneHead, surfaces: Sequence[Surface], textures: Path) -> HeadMesh | None:
    """What else may hide landmarks."""
    if sum(len(one.triangles) for one in surfaces) > MAX_TRIANGLES:
        head.problems.append(
            f"the rest of the scene has more than {MAX_TRIANGLES:,} triangles, so landmarks_visible "
            "does not know that it may hide the head"
        )
        return None
    return joined(surfaces, textures, ALL)


def _metres(scene: bpy.types.Scene) -> float:
    """In a unit of Blender."""
    settings = scene.unit_settings
    # Blender has 32 bits of it: 0.01 is 0.01.
    return float(f"{settings.scale_length:.7g}") if settings.system != "NONE" else 1.0


def _clip(scene: bpy.types.Scene) -> Numbers:
    """How near and how far its camera sees."""
    thing = scene.camera
    return (thing.data.clip_start, thing.data.clip_end) if thing and thing.type == "CAMERA" else ()


def _camera(head: SceneHead) -> tuple[SceneCamera | None, Numbers, str]:
    """The scene's own camera and its 4 x 4 in the world, or why it cannot be used."""
    thing, render = head.scene.camera, head.scene.render
    if thing is None or thing.type != "CAMERA":
        return None, (), "the scene has no camera"
    if thing in head.objects:
        return None, (), "the scene's camera is parented to the head"
    data = thing.data
    if data.type != "PERSP":
        return None, (), f"the scene's camera is {data.type.lower()}, and has to be a perspective one"
    there = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = np.array(there.matrix_world, dtype=np.float64)
    lengths = np.linalg.norm(world[:3, :3], axis=0)
    if not (lengths > 0).all():
        return None, (), "the scene's camera has a scale of 0"
    world[:3, :3] /= lengths
    if not np.allclose(world[:3, :3].T @ world[:3, :3], np.eye(3), atol=1e-5) or np.linalg.det(world) < 0:
        return None, (), "the scene's camera is sheared or mirrored"
    camera = SceneCamera(
        data.lens,
        data.sensor_width,
        data.sensor_height,
        FITS.index(data.sensor_fit),
        data.shift_x,
        data.shift_y,
        render.pixel_aspect_y / render.pixel_aspect_x,
        render.resolution_x,
        render.resolution_y,
    )
    return camera, tuple(world.reshape(-1).tolist()), ""

# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair of a scene, curves and particle systems, as thin tubes, which hide what is behind them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from generator.blender.scene_file import listed
from generator.heads.mesh import HeadMesh, Material

SIDES = 4
DEFAULT_RADIUS = 0.005
"""Of strands that say none, in Cycles, in their own units."""

MAX_PIECES = 1 << 19
"""Between points of strands; of more, every second, third, ... strand hides something."""


@dataclass(frozen=True)
class Strands:
    """Points float64 [P, 3] in the world and radii float64 [P], strand after strand; where each begins and
    the last one ends, int [S + 1]."""

    points: np.ndarray
    radii: np.ndarray
    offsets: np.ndarray


def strands(owners: Collection[bpy.types.Object]) -> HeadMesh | None:
    """The hair of some objects in the world; None where there is none."""
    graph = bpy.context.evaluated_depsgraph_get()
    vertices, triangles, count = [], [], 0
    for instance in graph.object_instances:
        here = instance.object
        owner = (instance.parent if instance.is_instance else here).original
        if owner not in owners or not (here.visible_camera and owner.visible_camera):
            continue
        world = np.array(instance.matrix_world, dtype=np.float64)
        found = [*_particles(here, world)] if instance.show_particles else []
        if here.type == "CURVES" and instance.show_self and len(here.data.points):
            found.append(_curves(here.data, world))
        for one in found:
            tubes = _tubes(one)
            vertices.append(tubes[0])
            triangles.append(tubes[1] + count)
            count += len(tubes[0])
    if not sum(map(len, triangles)):
        return None
    every = np.concatenate(triangles).astype(np.int32)
    return HeadMesh(
        np.concatenate(vertices), every, None, None, np.zeros(len(every), np.int32), (Material("hair"),)
    )


def both(hair: HeadMesh | None, cut: HeadMesh | None) -> HeadMesh | None:
    """The hair of a head, and what of the head is cut out of the picture: either hides what is behind."""
    if hair is None or cut is None:
        return cut if hair is None else hair
    return HeadMesh(
        np.concatenate([cut.vertices, hair.vertices]),
        np.concatenate([cut.triangles, hair.triangles + len(cut.vertices)]),
        None,
        None,
        np.zeros(len(cut.triangles) + len(hair.triangles), np.int32),
        hair.materials,
    )


def show_rendered_strands() -> None:
    """Have the strands of particle systems that Python can ask for be those that are rendered."""
    for settings in bpy.data.particles:
        settings.display_percentage = 100
        settings.child_percent = settings.rendered_child_count
        settings.display_step = settings.render_step


def rest_dynamics() -> list[str]:
    """Have hair that would be simulated anew, and otherwise for each picture, stand as it was groomed."""
    found = [
        (one, system)
        for one in bpy.data.objects
        for system in one.particle_systems
        if system.use_hair_dynamics and not (system.point_cache and system.point_cache.is_baked)
    ]
    for _, system in found:
        system.use_hair_dynamics = False
    said = "hair dynamics that are not baked are off; bake them in Blender"
    return [f"{listed(dict.fromkeys(one.name for one, _ in found))}: {said}"] if found else []


def _curves(data: bpy.types.Curves, world: np.ndarray) -> Strands:
    count = len(data.points)
    flat = np.empty(3 * count, dtype=np.float32)
    data.position_data.foreach_get("vector", flat)
    radius = np.full(count, DEFAULT_RADIUS, dtype=np.float32)
    if "radius" in data.attributes:
        data.attributes["radius"].data.foreach_get("value", radius)
    offsets = np.empty(len(data.curves) + 1, dtype=np.int32)
    data.curve_offset_data.foreach_get("value", offsets)
    return Strands(_moved(flat.reshape(-1, 3), world), radius * _scale(world), offsets)


def _particles(here: bpy.types.Object, world: np.ndarray) -> Iterator[Strands]:
    """Of each particle system that is rendered as strands: of its children, or of its own where it has none.

    Strands taper as Cycles' do (``shaperadius`` of blender/curves.cpp), which halves Blender's radius.
    """
    moved = world @ np.linalg.inv(np.array(here.matrix_world, dtype=np.float64))
    systems = {one.particle_system.name: one for one in here.modifiers if one.type == "PARTICLE_SYSTEM"}
    for system in here.particle_systems:
        settings, modifier = system.settings, systems.get(system.name)
        if settings.type != "HAIR" or settings.render_type != "PATH":
            continue
        if modifier is None or not modifier.show_render:
            continue
        own, children = len(system.particles), len(system.child_particles)
        with_children = settings.child_type != "NONE" and children > 0
        steps = (1 << settings.display_step) + 1
        steps += settings.kink_extra_steps if settings.kink == "SPIRAL" else 0
        first, last = (own, own + children) if with_children else (0, own)
        chosen = range(first, last, max(1, -(-(last - first) * (steps - 1) // MAX_PIECES)))
        if not len(chosen):
            continue
        places = [system.co_hair(here, particle_no=one, step=k) for one in chosen for k in range(steps)]
        shape = settings.shape
        taper = (1 - np.linspace(0, 1, steps)) ** (1 + shape if shape < 0 else 1 / max(1 - shape, 1e-6))
        radii = settings.tip_radius + (settings.root_radius - settings.tip_radius) * taper
        if settings.use_close_tip:
            radii[-1] = 0.0
        thick = np.tile(radii * settings.radius_scale / 2 * _scale(world), len(chosen))
        points = _moved(np.array(places, dtype=np.float64), moved)
        yield Strands(points, thick, steps * np.arange(len(chosen) + 1))


def _moved(points: np.ndarray, by: np.ndarray) -> np.ndarray:
    return points.astype(np.float64) @ by[:3, :3].T + by[:3, 3]


def _scale(world: np.ndarray) -> float:
    """By how much a matrix makes things thicker."""
    return float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))


def _tubes(one: Strands) -> tuple[np.ndarray, np.ndarray]:
    """Vertices float64 [V, 3] in the world, and triangles int64 [T, 3]."""
    points, radii, offsets = one.points, one.radii, one.offsets
    starts = np.setdiff1d(np.arange(len(points)), offsets[1:] - 1)
    if len(starts) > MAX_PIECES:
        strand = np.searchsorted(offsets, starts, side="right")
        starts = starts[strand % -(-len(starts) // MAX_PIECES) == 0]
    along = points[starts + 1] - points[starts]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    starts, along = starts[length[:, 0] > 0], (along / np.where(length > 0, length, 1))[length[:, 0] > 0]
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = aside[:, None] * np.cos(turn)[:, None] + np.cross(along, aside)[:, None] * np.sin(turn)[:, None]
    rings = [points[k][:, None] + circle * radii[k][:, None, None] for k in (starts, starts + 1)]
    vertices = np.concatenate(rings, axis=1).reshape(-1, 3)
    side = np.arange(SIDES)
    following = (side + 1) % SIDES
    piece = np.concatenate(
        [
            np.stack([side, following, side + SIDES], axis=1),
            np.stack([following, following + SIDES, side + SIDES], axis=1),
        ]
    )
    places = 2 * SIDES * np.arange(len(starts))
    return vertices, (places[:, None, None] + piece).reshape(-1, 3)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of a scene as they are rendered, and as much of their colours as a detector needs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from generator.blender.scene_file import SURFACES, listed
from generator.blender.scene_shading import Holes, image_behind, inputs_of, shading_of
from generator.heads.mesh import HeadMesh, Material

SEEN, CUT, ALL = "seen", "cut", "all"

TEXTURE_SIDE = 1024
"""Of the copies of images by which faces are found."""


@dataclass(frozen=True)
class Surface:
    """A mesh of the scene in the world.

    owner: the object it belongs to. vertices: float64 [V, 3]. triangles: int32 [T, 3]. uv: float32 [T, 3, 2].
    slots: int32 [T] into materials. cut: it is a hole in the picture, which hides what is behind.
    """

    owner: bpy.types.Object
    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray
    slots: np.ndarray
    materials: tuple[bpy.types.Material | None, ...]
    cut: bool = False

    def holding(self, part: str) -> np.ndarray:
        """Which triangles are SEEN, or CUT: there and not drawn; ALL are both. bool [T]."""
        kinds = [shading_of(material) for material in self.materials]
        solid = np.array([not one.clear for one in kinds])
        cut = np.array([one.cut or self.cut for one in kinds])
        chosen: np.ndarray = solid & {SEEN: ~cut, CUT: cut, ALL: np.ones_like(cut)}[part]
        return chosen[self.slots]


def placed_surfaces(owners: Collection[bpy.types.Object], *, others: bool = False) -> list[Surface]:
    """The surfaces of some objects, instances too, that the camera can see; or those of all others."""
    graph, layer = bpy.context.evaluated_depsgraph_get(), bpy.context.view_layer
    found: list[Surface] = []
    for instance in graph.object_instances:
        here = instance.object
        owner = (instance.parent if instance.is_instance else here).original
        if (owner in owners) == others or not instance.show_self or here.type not in SURFACES:
            continue
        # As Cycles has it: an instance is held out where what makes it is.
        cut = owner.holdout_get(view_layer=layer)
        unlit = owner.indirect_only_get(view_layer=layer) and not cut
        if unlit or not (here.visible_camera and owner.visible_camera):
            continue
        mesh = here.to_mesh()
        if mesh is not None and len(mesh.polygons):
            world = np.array(instance.matrix_world, dtype=np.float64)
            slots = tuple(slot.material for slot in here.material_slots) or tuple(mesh.materials) or (None,)
            found.append(_surface(owner, mesh, world, slots, cut))
        here.to_mesh_clear()
    return found


def _surface(
    owner: bpy.types.Object,
    mesh: bpy.types.Mesh,
    world: np.ndarray,
    materials: tuple[bpy.types.Material | None, ...],
    cut: bool,
) -> Surface:
    mesh.calc_loop_triangles()
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    placed = points.reshape(-1, 3).astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    count = len(mesh.loop_triangles)
    corners, loops = np.empty(3 * count, dtype=np.int32), np.empty(3 * count, dtype=np.int32)
    slots = np.empty(count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    mesh.loop_triangles.foreach_get("loops", loops)
    mesh.loop_triangles.foreach_get("material_index", slots)
    uv = _uv(mesh, loops).reshape(-1, 3, 2)
    triangles = corners.reshape(-1, 3)
    if np.linalg.det(world[:3, :3]) < 0:  # mirrored: or it would be seen from inside
        triangles, uv = triangles[:, ::-1], uv[:, ::-1]
    return Surface(owner, placed, triangles, uv, np.clip(slots, 0, len(materials) - 1), materials, cut)


def joined(surfaces: Collection[Surface], textures: Path, part: str = SEEN) -> HeadMesh | None:
    """Surfaces as one mesh in the world; those one can see through are left out. None where none is left.

    textures: a folder for copies of their images. part: of :meth:`Surface.holding`; colours are of what is
    seen alone.
    """
    vertices, triangles, uvs, indices = [], [], [], []
    materials: list[Material] = []
    known: dict[str, int] = {}
    count = 0
    for one in surfaces:
        solid = one.holding(part)
        made = [_material(m, known, materials, textures, part == SEEN) for m in one.materials]
        places = np.array(made, dtype=np.int32)
        vertices.append(one.vertices)
        triangles.append(one.triangles[solid] + count)
        indices.append(places[one.slots[solid]])
        uvs.append(one.uv[solid])
        count += len(one.vertices)
    if not sum(map(len, triangles)):
        return None
    return HeadMesh(
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(uvs).astype(np.float32),
        None,
        np.concatenate(indices),
        tuple(materials),
    )


def _uv(mesh: bpy.types.Mesh, loops: np.ndarray) -> np.ndarray:
    layer = next((one for one in mesh.uv_layers if one.active_render), None)
    if layer is None:
        return np.zeros((len(loops), 2), dtype=np.float32)
    flat = np.empty(2 * len(layer.uv), dtype=np.float32)
    layer.uv.foreach_get("vector", flat)
    return flat.reshape(-1, 2)[loops]


def unknown_shading(surfaces: Collection[Surface]) -> list[str]:
    """What is to be said of materials of which nobody knows what one can see through."""
    used = {material for one in surfaces for material in one.materials if material is not None}
    names = sorted(material.name for material in used if not shading_of(material).known)
    said = "where one can see through it is not known; for labels it is solid"
    return [f"{listed(names)}: {said}"] if names else []


def _material(
    one: bpy.types.Material | None,
    known: dict[str, int],
    materials: list[Material],
    textures: Path,
    seen: bool,
) -> int:
    name = one.name if one else ""
    if name not in known:
        known[name] = len(materials)
        colour, image = _colour(one) if seen else (Material.base_color, None)
        holes, texture = shading_of(one).holes, None
        if image is not None or holes is not None:
            texture = _texture(colour, image, holes, textures / f"{len(materials):03d}.png")
        materials.append(Material(name, colour, texture, cutout=texture is not None and holes is not None))
    return known[name]


def _colour(one: bpy.types.Material | None) -> tuple[tuple[float, float, float], bpy.types.Image | None]:
    """The colour of a material, sRGB, and the image it comes from."""
    if one is None:
        return Material.base_color, None
    socket, groups = next(inputs_of(one, "Base Color", "Color"), (None, ()))
    if socket is None:
        return _srgb(one.diffuse_color), None
    found = image_behind(socket, groups)
    if found is not None:
        return _srgb(one.diffuse_color), found[0]
    return _srgb(one.diffuse_color if socket.is_linked else socket.default_value), None


def _srgb(linear: Sequence[float]) -> tuple[float, float, float]:
    values = np.clip(np.array(linear[:3], dtype=np.float64), 0, 1)
    shown = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    return tuple(shown.tolist())


def _texture(
    colour: Sequence[float],
    image: bpy.types.Image | None,
    holes: Holes | None,
    path: Path,
) -> Path | None:
    """A small PNG of what a material shows; None where an image cannot be read."""
    first = image if image is not None or holes is None else holes.image
    width, height = first.size if first is not None else (1, 1)
    share = min(1.0, TEXTURE_SIDE / max(width, height, 1))
    size = max(1, round(width * share)), max(1, round(height * share))
    shown = None if image is None else _pixels(image, size)
    cut = None if holes is None else _pixels(holes.image, size)
    if (image is not None and shown is None) or (holes is not None and cut is None):
        return None  # a missing file: the material's own colour does
    if shown is None:
        shown = np.ones((size[0] * size[1], 4), dtype=np.float32)
        shown[:, :3] = colour
    shown[:, 3] = 1.0
    if holes is not None and cut is not None:
        shown[:, 3] = 1.0 - cut[:, holes.channel] if holes.inverted else cut[:, holes.channel]
    made = bpy.data.images.new("copy", *size, alpha=True)
    made.pixels.foreach_set(shown.ravel())
    made.filepath_raw, made.file_format = str(path), "PNG"
    made.save()
    bpy.data.images.remove(made)
    return path


def _pixels(image: bpy.types.Image, size: tuple[int, int]) -> np.ndarray | None:
    """float32 [size, 4] of an image of another size; None where it has none."""
    small = image.copy()
    try:
        small.scale(*size)
        flat = np.empty(4 * size[0] * size[1], dtype=np.float32)
        small.pixels.foreach_get(flat)
    except (RuntimeError, TypeError):
        return None
    finally:
        bpy.data.images.remove(small)
    return flat.reshape(-1, 4)

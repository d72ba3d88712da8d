# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of a scene as they are rendered, and as much of their colours as a detector needs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from generator.blender.scene_file import SURFACES
from generator.heads.mesh import HeadMesh, Material

TEXTURE_SIDE = 1024
"""Of the copies of images by which faces are found."""

SEE_THROUGH = 0.5
"""A surface that lets more light through than that is none that landmarks lie on or behind."""


@dataclass(frozen=True)
class Surface:
    """A mesh of the scene in the world.

    owner: the object it belongs to. vertices: float64 [V, 3]. triangles: int32 [T, 3]. uv: float32 [T, 3, 2].
    slots: int32 [T] into materials.
    """

    owner: bpy.types.Object
    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray
    slots: np.ndarray
    materials: tuple[bpy.types.Material | None, ...]


def placed_surfaces(owners: Collection[bpy.types.Object], *, others: bool = False) -> list[Surface]:
    """The surfaces of some objects, instances too, that the camera can see; or those of all others."""
    graph = bpy.context.evaluated_depsgraph_get()
    found: list[Surface] = []
    for instance in graph.object_instances:
        here = instance.object
        owner = (instance.parent if instance.is_instance else here).original
        shown = instance.show_self and here.visible_camera and not here.is_holdout
        if (owner in owners) == others or not shown or here.type not in SURFACES:
            continue
        mesh = here.to_mesh()
        if mesh is not None and len(mesh.polygons):
            world = np.array(instance.matrix_world, dtype=np.float64)
            slots = tuple(slot.material for slot in here.material_slots) or tuple(mesh.materials) or (None,)
            found.append(_surface(owner, mesh, world, slots))
        here.to_mesh_clear()
    return found


def _surface(
    owner: bpy.types.Object,
    mesh: bpy.types.Mesh,
    world: np.ndarray,
    materials: tuple[bpy.types.Material | None, ...],
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
    return Surface(owner, placed, triangles, uv, np.clip(slots, 0, len(materials) - 1), materials)


def joined(surfaces: Collection[Surface], textures: Path | None) -> HeadMesh | None:
    """Surfaces as one mesh in the world; those one can see through are left out. None where none is left.

    textures: a folder for copies of their images; None leaves colours out.
    """
    vertices, triangles, uvs, indices = [], [], [], []
    materials: list[Material] = []
    known: dict[str, int] = {}
    count = 0
    for one in surfaces:
        solid = np.array([not _is_see_through(material) for material in one.materials])[one.slots]
        places = np.array([_material(m, known, materials, textures) for m in one.materials], dtype=np.int32)
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


def _material(
    one: bpy.types.Material | None, known: dict[str, int], materials: list[Material], textures: Path | None
) -> int:
    name = one.name if one else ""
    if name not in known:
        known[name] = len(materials)
        colour, image = _colour(one)
        holes, texture = _holes(one), None
        if textures is not None and (image is not None or holes is not None):
            texture = _texture(colour, image, holes, textures / f"{len(materials):03d}.png")
        materials.append(Material(name, colour, texture, cutout=texture is not None and holes is not None))
    return known[name]


def _colour(one: bpy.types.Material | None) -> tuple[tuple[float, float, float], bpy.types.Image | None]:
    """The colour of a material, sRGB, and the image it comes from."""
    if one is None:
        return Material.base_color, None
    socket = _socket(one, "Base Color", "Color")
    if socket is None:
        return _srgb(one.diffuse_color), None
    found = _image_behind(socket)
    if found is not None:
        return _srgb(one.diffuse_color), found[0]
    return _srgb(one.diffuse_color if socket.is_linked else socket.default_value), None


def _holes(one: bpy.types.Material | None) -> tuple[bpy.types.Image, int] | None:
    """The image that makes holes in a material, and which of its channels does."""
    socket = None if one is None else _socket(one, "Alpha")
    return None if socket is None else _image_behind(socket)


def _image_behind(socket: bpy.types.NodeSocket) -> tuple[bpy.types.Image, int] | None:
    """The first image that an input comes from, and the channel: 3 where it is the image's alpha."""
    waiting, seen = [socket], set()
    while waiting:
        for link in waiting.pop(0).links:
            node = link.from_node
            if node.type == "TEX_IMAGE" and node.image is not None and node.image.source != "TILED":
                return node.image, 3 if link.from_socket.name == "Alpha" else 0
            if node.name not in seen:
                seen.add(node.name)
                waiting += node.inputs
    return None


def _socket(one: bpy.types.Material, *names: str) -> bpy.types.NodeSocket | None:
    """The first input of these names of the shaders of a material."""
    if not one.use_nodes or one.node_tree is None:
        return None
    shaders = [
        node for node in one.node_tree.nodes if node.type.startswith(("BSDF", "EMISSION", "SUBSURFACE"))
    ]
    return next((node.inputs[name] for name in names for node in shaders if name in node.inputs), None)


def _is_see_through(one: bpy.types.Material | None) -> bool:
    """A pane of glass, a cornea: is there a shader that lets light through, and no other?"""
    if one is None or not one.use_nodes or one.node_tree is None:
        return False
    clear, solid = False, False
    for node in one.node_tree.nodes:
        if node.type in ("BSDF_GLASS", "BSDF_TRANSPARENT", "BSDF_REFRACTION"):
            clear = True
        elif node.type == "BSDF_PRINCIPLED":
            through, alpha = node.inputs.get("Transmission Weight"), node.inputs["Alpha"]
            opaque = alpha.is_linked or alpha.default_value > SEE_THROUGH
            passes = through is not None and not through.is_linked and through.default_value > SEE_THROUGH
            clear, solid = clear or passes or not opaque, solid or (opaque and not passes)
        elif node.type.startswith(("BSDF", "EMISSION", "SUBSURFACE")):
            solid = solid or node.type != "BSDF_GLOSSY"
    return clear and not solid


def _srgb(linear: Sequence[float]) -> tuple[float, float, float]:
    values = np.clip(np.array(linear[:3], dtype=np.float64), 0, 1)
    shown = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    return tuple(shown.tolist())


def _texture(
    colour: Sequence[float],
    image: bpy.types.Image | None,
    holes: tuple[bpy.types.Image, int] | None,
    path: Path,
) -> Path | None:
    """A small PNG of what a material shows; None where an image cannot be read."""
    first = image if image is not None or holes is None else holes[0]
    width, height = first.size if first is not None else (1, 1)
    share = min(1.0, TEXTURE_SIDE / max(width, height, 1))
    size = max(1, round(width * share)), max(1, round(height * share))
    shown = None if image is None else _pixels(image, size)
    cut = None if holes is None else _pixels(holes[0], size)
    if (image is not None and shown is None) or (holes is not None and cut is None):
        return None  # a missing file: the material's own colour does
    if shown is None:
        shown = np.ones((size[0] * size[1], 4), dtype=np.float32)
        shown[:, :3] = colour
    shown[:, 3] = 1.0 if holes is None or cut is None else cut[:, holes[1]]
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

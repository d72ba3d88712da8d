# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront OBJ, read strictly.

Not through trimesh: its OBJ loader splits vertices along texture seams, sorts
materials by name, and turns every problem with a material or a texture into a
log line and a grey mesh. Here a missing texture is an error.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.colors import unit_colors
from generator.heads.limits import read_mesh_bytes
from generator.heads.mesh import HeadMesh, Material
from generator.heads.mtl import MtlMaterial, decode, find_libraries, find_stem_texture, read_mtl
from generator.heads.obj_lines import ObjLines, parse_lines
from generator.heads.paths import MissingFile, find_inside
from generator.heads.textures import Textures, combine_alpha
from generator.heads.triangles import of_polygons

SKIN = (0.80, 0.62, 0.53)
"""sRGB of a head that comes without any colour."""

SEE_THROUGH = 0.5
"""Triangles of a material with less opacity than this are left out (corneas, tear films)."""


def read_obj(path: Path, scratch: Path, texture: Path | None = None) -> HeadMesh:
    """An OBJ with its MTL and textures; vertices as written, polygons cut into fans.

    scratch: where the texture of a material with a separate opacity map goes.
    texture: draws the whole mesh with this image, whatever the MTL says.

    Raises
    ------
    HeadError: the file cannot be parsed, an index points nowhere, or a
        texture is missing, outside of the folder or not an image.
    """
    obj = parse_lines(decode(read_mesh_bytes(path)))
    if not obj.positions:
        raise HeadError("the file has no vertices, or is not an OBJ file")
    vertices = obj.table(obj.positions, 3)
    colors = unit_colors(obj.table(obj.colors, 3)) if obj.colors else None
    position, corner_uv, material_index = _polygons(obj)
    if not len(position):
        raise HeadError("the file has no faces; export the head as polygons")
    if position.min() < 1 or position.max() > len(vertices):
        raise HeadError(f"a face uses a vertex outside of 1 to {len(vertices)}; export the mesh again")
    # Row 0 serves the corners that name no texture coordinate.
    table = np.concatenate([[[0.0, 0.0]], obj.table(obj.uvs, 2)])
    if corner_uv.max() >= len(table):
        raise HeadError(f"a face uses a texture coordinate beyond {len(table) - 1}; export the mesh again")
    if not np.isfinite(table).all():
        raise HeadError("a texture coordinate is not a finite number; export the mesh again")
    names = list(obj.materials)
    problems: list[str] = []
    if texture:
        entries = dict.fromkeys(names, MtlMaterial(texture=texture.name))
    else:
        entries, problems = _library(path, names, colored=colors is not None)
    mapped = any(entry.texture or entry.opacity_map for entry in entries.values())
    uv = table.astype(np.float32)[corner_uv] if mapped else None
    textures = Textures()
    materials, clear, keep = [], [], np.ones(len(position), dtype=bool)
    for index, name in enumerate(names):
        entry, of_material = entries[name], material_index == index
        material = Material(name or "skin", entry.color or SKIN)
        seen = bool(entry.opacity_map) or entry.opacity >= SEE_THROUGH
        if uv is not None and (entry.texture or entry.opacity_map):
            placed = table[corner_uv[of_material]]
            placed *= entry.scale  # in place: of a scan of millions each copy counts
            placed += entry.offset
            if entry.opacity_map:
                opacity = find_inside(path.parent, entry.opacity_map, "opacity map")
                used = placed[(corner_uv[of_material] > 0).all(axis=1)]
                seen = textures.peak_opacity(opacity, used, (entry.wrap, entry.wrap)) >= SEE_THROUGH
            material, uv[of_material] = _textured(path, scratch, textures, index, material, entry, placed)
            if bare := int((corner_uv[of_material] == 0).any(axis=1).sum()):
                problems.append(
                    f"{bare} triangles of the textured {quoted(name)} have no texture coordinates"
                )
        if not seen:
            keep &= ~of_material
            clear.append(f"the see-through material {quoted(name)} is left out")
        materials.append(material)
        if entry.ambient:
            problems.append(f"the material {quoted(name)} has its texture as map_Ka alone; drawn with it")
        if entry.emissive and not entry.texture:
            problems.append(f"the emissive texture of {quoted(name)} is not drawn")
        if entry.color is None and not material.texture and colors is None:
            problems.append(f"no texture or colour for the material {quoted(name)}; drawn as plain skin")
    if keep.any():
        problems += clear
    else:  # d or Tr written the other way round
        keep[:] = True
    textured = [m.texture is not None for m in materials]
    return HeadMesh(
        vertices=vertices,
        triangles=position[keep] - 1,
        uv=None if uv is None else uv[keep],
        vertex_colors=None if all(textured) else colors,
        material_index=material_index[keep],
        materials=tuple(materials),
        problems=tuple(problems),
    )


def _polygons(obj: ObjLines) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """int32 [T, 3] vertices and texture coordinates of fans, from 1 on, and int32 [T] materials."""
    position = np.frombuffer(obj.corner_position, dtype=np.int32)
    uv = np.frombuffer(obj.corner_uv, dtype=np.int32)
    counts = np.frombuffer(obj.face_corners, dtype=np.int32)
    material = np.frombuffer(obj.face_material, dtype=np.int32)
    if (counts == 3).all():
        return position.reshape(-1, 3), uv.reshape(-1, 3), material
    corners, face = of_polygons(counts.astype(np.int64))
    return position[corners], uv[corners], material[face]


def _library(path: Path, names: list[str], *, colored: bool) -> tuple[dict[str, MtlMaterial], list[str]]:
    """An entry for each name the faces use, from the MTLs or from an image beside the mesh.

    colored: the mesh can do without them. Raises MissingFile: it cannot, and an MTL that it names is missing;
    where it can, :func:`obj_files` has noted that.
    """
    libraries = find_libraries(path)
    known: dict[str, MtlMaterial] = {}
    for file in libraries.files:
        known = read_mtl(file) | known  # of two materials of one name the first is meant
    problems: list[str] = []
    if not known:
        image = find_stem_texture(path)
        if libraries.missing and not image and not colored:
            raise MissingFile(libraries.missing[0])
        return {name: MtlMaterial(texture=image.name if image else None) for name in names}, problems
    if len(known) == 1 and len(names) == 1:
        (only,) = known
        if names[0] and names[0] != only:
            what = f"the material {quoted(names[0])} is not in the material file"
            problems.append(f"{what}; drawn as {quoted(only)}, the only one there")
        return {names[0]: known[only]}, problems
    missing = [name for name in names if name and name not in known]
    if missing and libraries.missing and not colored:
        raise MissingFile(libraries.missing[0])
    problems += [f"the material {quoted(name)} is not in the material file" for name in missing]
    return {name: known.get(name, MtlMaterial()) for name in names}, problems


def _textured(
    path: Path,
    scratch: Path,
    textures: Textures,
    index: int,
    material: Material,
    entry: MtlMaterial,
    uv: np.ndarray,
) -> tuple[Material, np.ndarray]:
    """A material with its texture, or plain with cut-outs, and its coordinates, float64 [T, 3, 2], brought
    back into that."""
    wraps = (entry.wrap, entry.wrap)
    color: Path | tuple[float, float, float] = material.base_color
    if entry.texture:
        color = find_inside(path.parent, entry.texture, "texture")
        textures.check(color)
    if entry.opacity_map and entry.opacity_map != entry.texture:
        opacity = find_inside(path.parent, entry.opacity_map, "opacity map")
        combined = scratch / f"{path.stem}-cutout{index}.png"
        combine_alpha(color, opacity, combined)
        laid, moved, _ = textures.lay(replace(material, texture=combined), uv, wraps)
        if laid.cutout:
            return laid, moved
    if isinstance(color, tuple):
        return material, uv
    laid, moved, _ = textures.lay(replace(material, texture=color), uv, wraps)
    return laid, moved


def obj_files(path: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The MTL and images an OBJ may be drawn with, without reading the mesh, and what is missing.

    Raises
    ------
    HeadError: the MTL is broken or names a file outside of the folder.
    """
    libraries = find_libraries(path)
    files, problems = dict.fromkeys(libraries.files), list(libraries.missing)
    known = [material for file in libraries.files for material in read_mtl(file).values()]
    if not known and (image := find_stem_texture(path)):
        files[image] = None
    for material in known:
        for name in (material.texture, material.opacity_map):
            try:
                if name:
                    files[find_inside(path.parent, name, "texture")] = None
            except MissingFile as error:
                problems.append(str(error))
    return tuple(files), tuple(dict.fromkeys(problems))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront OBJ, read strictly.

Not through trimesh: its OBJ loader splits vertices along texture seams, sorts
materials by name, and turns every problem with a material or a texture into a
log line and a grey mesh. Here a missing texture is an error.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.colors import unit_colors
from generator.heads.limits import MAX_MATERIALS, check_count, read_mesh_bytes
from generator.heads.mesh import HeadMesh, Material
from generator.heads.mtl import MtlMaterial, decode, find_libraries, find_stem_texture, read_mtl
from generator.heads.paths import MissingFile, find_inside
from generator.heads.textures import Textures, combine_alpha

SKIN = (0.80, 0.62, 0.53)
"""sRGB of a head that comes without any colour."""

SEE_THROUGH = 0.5
"""Triangles of a material with less opacity than this are left out (corneas, tear films)."""

MAX_INDEX = 1 << 40


@dataclass
class _Obj:
    positions: list[list[str]] = field(default_factory=list)
    uvs: list[list[str]] = field(default_factory=list)
    corner_position: list[int] = field(default_factory=list)
    corner_uv: list[int] = field(default_factory=list)
    face_corners: list[int] = field(default_factory=list)
    face_material: list[int] = field(default_factory=list)
    materials: dict[str, int] = field(default_factory=dict)


def read_obj(path: Path, scratch: Path, texture: Path | None = None) -> HeadMesh:
    """An OBJ with its MTL and textures; vertices as written, polygons cut into fans.

    scratch: where the texture of a material with a separate opacity map goes.
    texture: draws the whole mesh with this image, whatever the MTL says.

    Raises
    ------
    HeadError: the file cannot be parsed, an index points nowhere, or a
        texture is missing, outside of the folder or not an image.
    """
    obj = _parse(decode(read_mesh_bytes(path)))
    vertices, colors = _vertex_arrays(obj)
    corners, material_index = _triangulate(obj)
    if not len(corners):
        raise HeadError("the file has no faces; export the head as polygons")
    position = np.array(obj.corner_position)[corners]
    if position.min() < 1 or position.max() > len(vertices):
        raise HeadError(f"a face uses a vertex outside of 1 to {len(vertices)}; export the mesh again")
    corner_uv = np.array(obj.corner_uv)[corners]
    if corner_uv.max() > len(obj.uvs):
        raise HeadError(f"a face uses a texture coordinate beyond {len(obj.uvs)}; export the mesh again")
    try:
        # Row 0 serves the corners that name no texture coordinate; v may be left out.
        table = np.array([[0.0, 0.0]] + [[float(x) for x in [*row, "0", "0"][:2]] for row in obj.uvs])
    except ValueError as error:
        raise HeadError(f"a texture coordinate is not a number ({error}); export the mesh again") from error
    if not np.isfinite(table).all():
        raise HeadError("a texture coordinate is not a finite number; export the mesh again")
    names = list(obj.materials)
    problems: list[str] = []
    if texture:
        entries = dict.fromkeys(names, MtlMaterial(texture=texture.name))
    else:
        entries, problems = _library(path, names, colored=colors is not None)
    uv = table[corner_uv]
    textures = Textures()
    materials, keep = [], np.ones(len(position), dtype=bool)
    for index, name in enumerate(names):
        entry, of_material = entries[name], material_index == index
        if entry.opacity < SEE_THROUGH and not entry.texture:
            keep &= ~of_material
            problems.append(f"the see-through material {quoted(name)} is left out")
        uv[of_material] = uv[of_material] * entry.scale + entry.offset
        material = Material(name or "skin", entry.color or SKIN)
        if entry.texture:
            material, uv[of_material] = _textured(
                path, scratch, textures, index, material, entry, uv[of_material]
            )
            if bare := int((corner_uv[of_material] == 0).any(axis=1).sum()):
                problems.append(
                    f"{bare} triangles of the textured {quoted(name)} have no texture coordinates"
                )
        materials.append(material)
        if entry.ambient:
            problems.append(f"the material {quoted(name)} has its texture as map_Ka alone; drawn with it")
        if entry.color is None and not entry.texture and colors is None:
            problems.append(f"no texture or colour for the material {quoted(name)}; drawn as plain skin")
    if not keep.any():
        keep[:] = True
    textured = [m.texture is not None for m in materials]
    return HeadMesh(
        vertices=vertices,
        triangles=(position[keep] - 1).astype(np.int32),
        uv=uv[keep].astype(np.float32) if any(textured) else None,
        vertex_colors=None if all(textured) else colors,
        material_index=material_index[keep],
        materials=tuple(materials),
        problems=tuple(problems),
    )


def _parse(text: str) -> _Obj:
    obj = _Obj()
    corner_position, corner_uv = obj.corner_position, obj.corner_uv
    material = -1
    lines = text.split("\n")
    number = 0
    try:
        for number, line in enumerate(lines, 1):  # noqa: B007, the error below names the line
            words = line.split()
            if not words:
                continue
            key = words[0]
            if key == "v":
                obj.positions.append(words[1:])
            elif key == "vt":
                obj.uvs.append(words[1:])
            elif key == "f":
                if len(words) < 4:
                    raise ValueError("a face needs three corners")
                if material < 0:
                    material = obj.materials.setdefault("", len(obj.materials))
                obj.face_corners.append(len(words) - 1)
                obj.face_material.append(material)
                for word in words[1:]:
                    parts = word.split("/")
                    v = int(parts[0])
                    corner_position.append(v if 0 < v < MAX_INDEX else _absolute(v, len(obj.positions)))
                    if len(parts) > 1 and parts[1]:
                        t = int(parts[1])
                        corner_uv.append(t if 0 < t < MAX_INDEX else _absolute(t, len(obj.uvs)))
                    else:
                        corner_uv.append(0)
            elif key == "usemtl":
                name = line.strip()[6:].strip()
                material = obj.materials.setdefault(name, len(obj.materials))
                check_count(len(obj.materials), MAX_MATERIALS, "materials")
    except ValueError as error:
        raise HeadError(
            f"line {number} cannot be read: {quoted(lines[number - 1])}; export the mesh again"
        ) from error
    return obj


def _absolute(index: int, count: int) -> int:
    """1-based index of a negative one, which counts back from the last element so far."""
    if not -count <= index < 0:
        raise ValueError("an index points nowhere")
    return index + count + 1


def _vertex_arrays(obj: _Obj) -> tuple[np.ndarray, np.ndarray | None]:
    if not obj.positions:
        raise HeadError("the file has no vertices, or is not an OBJ file")
    try:
        vertices = np.array([[float(x) for x in row[:3]] for row in obj.positions])
        colors = None
        if min(map(len, obj.positions)) >= 6:
            colors = np.array([[float(x) for x in row[3:6]] for row in obj.positions])
    except ValueError as error:
        raise HeadError("a vertex line is not made of three numbers; export the mesh again") from error
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise HeadError("a vertex line is not made of three numbers; export the mesh again")
    if colors is not None:
        colors = unit_colors(colors)
    return vertices, colors


def _triangulate(obj: _Obj) -> tuple[np.ndarray, np.ndarray]:
    """Fans: int64 [T, 3] into the corners, int32 [T] material."""
    count = np.array(obj.face_corners, dtype=np.int64)
    triangles = count - 2
    first = np.repeat(np.cumsum(count) - count, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    corners = np.stack([first, first + step + 1, first + step + 2], axis=1)
    return corners, np.repeat(np.array(obj.face_material, dtype=np.int32), triangles)


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
    """A material with its texture, and its coordinates, float64 [T, 3, 2], brought back into that."""
    assert entry.texture is not None, "asked for materials with a texture alone"
    texture = find_inside(path.parent, entry.texture, "texture")
    textures.check(texture)
    wraps = (entry.wrap, entry.wrap)
    if entry.opacity_map and entry.opacity_map != entry.texture:
        opacity = find_inside(path.parent, entry.opacity_map, "opacity map")
        combined = scratch / f"{path.stem}-cutout{index}.png"
        combine_alpha(texture, opacity, combined)
        laid, moved, _ = textures.lay(replace(material, texture=combined), uv, wraps)
        if laid.cutout:
            return laid, moved
    laid, moved, _ = textures.lay(replace(material, texture=texture), uv, wraps)
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

# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY through trimesh: ASCII and binary, vertex colours, textures named in the header."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from trimesh.exchange.ply import load_ply
from trimesh.geometry import triangulate_quads

from generator.errors import HeadError
from generator.heads.colors import unit_colors
from generator.heads.limits import MAX_MATERIALS, check_count, check_mesh_file, read_mesh_bytes
from generator.heads.mesh import HeadMesh, Material
from generator.heads.mtl import decode
from generator.heads.obj import SKIN
from generator.heads.paths import find_inside
from generator.heads.ply_faces import paint, polygon_triangles, strip_triangles, vertex_uv
from generator.heads.textures import Textures
from generator.heads.tiling import REPEAT

HEADER_BYTES = 1 << 16


def read_ply(path: Path, scratch: Path) -> HeadMesh:
    """A PLY with its textures, if the header names any; scratch: an image of its faces' colours goes there.

    Raises
    ------
    HeadError: the file cannot be parsed, or a texture is missing, outside
        of the folder or not an image.
    """
    images, textures = ply_textures(path), Textures()
    for image in images:
        textures.check(image)
    try:
        with warnings.catch_warnings():
            # numpy's word for a line of numbers that holds something else
            warnings.simplefilter("error", DeprecationWarning)
            # Without a texture the vertices must stay as they are, in step with their colours.
            data = load_ply(io.BytesIO(read_mesh_bytes(path)), fix_texture=bool(images), skip_materials=True)
            vertices = np.asarray(data.get("vertices", ()), dtype=np.float64)
            elements = data["metadata"]["_ply_raw"]
            strips = None if data.get("faces") is not None else strip_triangles(elements)
            triangles = _triangles(data.get("faces")) if strips is None else strips
            uv = getattr(data.get("visual"), "uv", None) if strips is None else vertex_uv(elements)
            colors = None if images else _colors(data.get("vertex_colors"), len(vertices))
            index = _texture_numbers(data, len(images), len(triangles))
            painted = None
            if not images and colors is None and strips is None:
                painted = _painted(data.get("face_colors"), elements, scratch / f"{path.stem}-faces.png")
    except (HeadError, OSError):
        raise
    except Exception as error:  # trimesh raises whatever a malformed file makes it stumble over
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a PLY file that can be read ({what}); export it as triangles, binary PLY"
        ) from error
    if not len(triangles):
        raise HeadError("the strips of the file hold no triangle; export it as triangles")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise HeadError(f"a face uses a vertex outside of 0 to {len(vertices) - 1}; export the mesh again")
    problems = []
    if images and uv is None:
        raise HeadError(f"the mesh names the texture {images[0].name} but has no texture coordinates")
    corner_uv = np.asarray(uv, dtype=np.float32)[triangles] if images else None
    materials = [Material("skin", SKIN, image) for image in images] or [Material("skin", SKIN)]
    if painted is not None:
        triangles, corner_uv, image = painted
        materials, index = [Material("skin", SKIN, image)], np.zeros(len(triangles), dtype=np.int32)
    elif corner_uv is not None:
        for number, material in enumerate(materials):
            own = index == number
            materials[number], corner_uv[own], _ = textures.lay(material, corner_uv[own], (REPEAT, REPEAT))
    elif colors is None:
        problems.append("no texture or vertex colours; drawn as plain skin")
    return HeadMesh(
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        uv=corner_uv,
        vertex_colors=colors,
        material_index=index,
        materials=tuple(materials),
        problems=tuple(problems),
    )


def ply_textures(path: Path) -> tuple[Path, ...]:
    """The images of the header's lines ``comment TextureFile``, in their order.

    Raises
    ------
    HeadError: no PLY header, or an image is missing or outside of the folder.
    """
    check_mesh_file(path)
    with path.open("rb") as file:
        header, end, _ = file.read(HEADER_BYTES).partition(b"end_header")
    if not header.startswith(b"ply") or not end:
        raise HeadError("the file has no PLY header")
    lines = [line.split(None, 2) for line in decode(header).split("\n")]
    names = [line[2] for line in lines if len(line) == 3 and line[0] == "comment"
             and line[1].lower() == "texturefile"]  # fmt: skip
    check_count(len(names), MAX_MATERIALS, "textures")
    return tuple(find_inside(path.parent, name, "texture") for name in names)


def _texture_numbers(data: dict[str, Any], images: int, triangles: int) -> np.ndarray:
    """Which image each triangle has, int32 [T]: the property ``texnumber`` of the faces."""
    if images < 2:
        return np.zeros(triangles, dtype=np.int32)
    faces = data["metadata"]["_ply_raw"]["face"]
    if "texnumber" not in faces["properties"]:
        raise HeadError(
            "the header names several textures, but no face its texnumber; keep one, or export GLB"
        )
    numbers = np.asarray(faces["data"]["texnumber"]).reshape(-1)
    if not ((numbers >= 0) & (numbers < images)).all():
        raise HeadError(f"a face has a texnumber outside of 0 to {images - 1}; export the mesh again")
    if np.shape(data["faces"]) == (len(numbers), 4):
        numbers = np.tile(numbers, 2)  # as triangulate_quads puts all first halves before the second ones
    if len(numbers) != triangles:
        raise HeadError("faces of several textures have different numbers of corners; export triangles")
    return numbers.astype(np.int32)


def _triangles(faces: np.ndarray | None) -> np.ndarray:
    if faces is None or not len(faces):
        raise HeadError("the file has no faces; a point cloud cannot be rendered")
    if min(map(len, faces)) < 3:
        raise HeadError("a face has fewer than three corners; export the mesh again")
    return np.asarray(faces if np.shape(faces)[1:] == (3,) else triangulate_quads(faces), dtype=np.int64)


def _painted(
    values: np.ndarray | None, elements: dict[str, Any], image: Path
) -> tuple[np.ndarray, np.ndarray, Path] | None:
    """Triangles, float32 [T, 3, 2] coordinates and an image of faces with a colour each; None without."""
    polygons = polygon_triangles(elements)
    colors = None if values is None or polygons is None else _colors(values, len(values))
    if colors is None or polygons is None:
        return None
    triangles, face = polygons
    uv = paint(np.round(colors * 255).astype(np.uint8), image)
    return triangles, np.repeat(uv[face][:, None], 3, axis=1), image


def _colors(values: np.ndarray | None, count: int) -> np.ndarray | None:
    """sRGB 0-1 of integers of any width or of floats; None where there are none.

    Integers of more than eight bits that stay below 256 are 0-255 all the same.
    """
    if values is None or len(values) != count:
        return None
    colors = np.asarray(values)[:, :3]
    whole = np.issubdtype(colors.dtype, np.integer)
    if whole and (colors.dtype.itemsize == 1 or colors.max(initial=0) > 255):
        return np.clip(colors / np.iinfo(colors.dtype).max, 0, 1).astype(np.float32)
    return unit_colors(colors)

# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY through trimesh: ASCII and binary, vertex colours, one texture named in the header."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from trimesh.exchange.ply import load_ply
from trimesh.geometry import triangulate_quads

from generator.errors import HeadError
from generator.heads.limits import check_mesh_file, read_mesh_bytes
from generator.heads.mesh import HeadMesh, Material
from generator.heads.obj import SKIN
from generator.heads.paths import find_inside
from generator.heads.textures import Textures

HEADER_BYTES = 1 << 16


def read_ply(path: Path) -> HeadMesh:
    """A PLY with its texture, if the header names one.

    Raises
    ------
    HeadError: the file cannot be parsed, or its texture is missing, outside
        of the folder or not an image.
    """
    texture, textures = ply_texture(path), Textures()
    if texture:
        textures.check(texture)
    try:
        with warnings.catch_warnings():
            # numpy's word for a line of numbers that holds something else
            warnings.simplefilter("error", DeprecationWarning)
            # Without a texture the vertices must stay as they are, in step with their colours.
            data = load_ply(io.BytesIO(read_mesh_bytes(path)), fix_texture=bool(texture), skip_materials=True)
            vertices = np.asarray(data.get("vertices", ()), dtype=np.float64)
            triangles = _triangles(data.get("faces"))
            colors = None if texture else _colors(data.get("vertex_colors"), len(vertices))
    except (HeadError, OSError):
        raise
    except Exception as error:  # trimesh raises whatever a malformed file makes it stumble over
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a PLY file that can be read ({what}); export it as triangles, binary PLY"
        ) from error
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise HeadError(f"a face uses a vertex outside of 0 to {len(vertices) - 1}; export the mesh again")
    uv = getattr(data.get("visual"), "uv", None)
    problems = []
    if texture and uv is None:
        raise HeadError(f"the mesh names the texture {texture.name} but has no texture coordinates")
    if texture is None and colors is None:
        problems.append("no texture or vertex colours; drawn as plain skin")
    corner_uv = np.asarray(uv, dtype=np.float32)[triangles] if texture else None
    cutout = texture is not None and corner_uv is not None and textures.has_holes(texture, corner_uv)
    return HeadMesh(
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        uv=corner_uv,
        vertex_colors=colors,
        material_index=np.zeros(len(triangles), dtype=np.int32),
        materials=(Material("skin", SKIN, texture, cutout),),
        problems=tuple(problems),
    )


def ply_texture(path: Path) -> Path | None:
    """The image of the header's ``comment TextureFile``, else None.

    Raises
    ------
    HeadError: no PLY header, or the image is missing or outside of the folder.
    """
    check_mesh_file(path)
    with path.open("rb") as file:
        header, end, _ = file.read(HEADER_BYTES).partition(b"end_header")
    if not header.startswith(b"ply") or not end:
        raise HeadError("the file has no PLY header")
    for line in header.decode("latin-1").splitlines():
        words = line.split(None, 2)
        if len(words) == 3 and words[0] == "comment" and words[1].lower() == "texturefile":
            return find_inside(path.parent, words[2], "texture")
    return None


def _triangles(faces: np.ndarray | None) -> np.ndarray:
    if faces is None or not len(faces):
        raise HeadError("the file has no faces; a point cloud cannot be rendered")
    if min(map(len, faces)) < 3:
        raise HeadError("a face has fewer than three corners; export the mesh again")
    return np.asarray(faces if np.shape(faces)[1:] == (3,) else triangulate_quads(faces), dtype=np.int64)


def _colors(values: np.ndarray | None, count: int) -> np.ndarray | None:
    """sRGB 0-1 of integers of any width or of floats; None where there are none."""
    if values is None or len(values) != count:
        return None
    colors = np.asarray(values)[:, :3]
    scale = np.iinfo(colors.dtype).max if np.issubdtype(colors.dtype, np.integer) else 1.0
    if not np.isfinite(colors).all():
        raise HeadError("a vertex colour is not a finite number; export the mesh again")
    return np.clip(colors / scale, 0, 1).astype(np.float32)

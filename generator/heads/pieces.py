# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a scene, each with a material as its file describes it, put together to one mesh.

What glTF and Collada have in common once they are read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.mesh import HeadMesh, Material
from generator.heads.obj import SEE_THROUGH, SKIN
from generator.heads.textures import Textures
from generator.heads.tiling import REPEAT

WHITE = 1 - 0.5 / 255
"""Vertex colours are drawn with eight bits: from here on they are 1."""


@dataclass(frozen=True)
class Piece:
    """A primitive where a node puts it.

    vertices: float64 [V, 3], the scene's frame. triangles: int64 [T, 3], outside counter-clockwise.
    uv: float32 [V, 2], v up. color: COLOR_0 as stored. material: its number.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray | None
    color: np.ndarray | None
    material: int | None


@dataclass(frozen=True)
class PieceMaterial:
    """How the file colours pieces. color: sRGB, None if not given. factor: the same, linear.

    mode: alphaMode. cutoff: what MASK shows has at least this alpha. transmission: 0-1 of the light that
    passes; where, the red of transmission_map says. wraps: how the
    texture goes on along u and v. note: what of it is not drawn.
    """

    name: str
    color: tuple[float, float, float] | None = None
    factor: np.ndarray = field(default_factory=lambda: np.ones(3))
    opacity: float = 1.0
    mode: str = "OPAQUE"
    cutoff: float = 0.5
    transmission: float = 0.0
    transmission_map: Path | None = None
    texture: Path | None = None
    wraps: tuple[str, str] = (REPEAT, REPEAT)
    note: str = ""


def assemble(pieces: Iterable[Piece], sources: list[PieceMaterial], textures: Textures) -> HeadMesh:
    """One mesh of all pieces but the see-through ones.

    sources: the materials; the last is that of pieces that name none.

    Raises
    ------
    HeadError: nothing can be seen, a texture without coordinates, or as :class:`Textures` does.
    """
    vertices, triangles, uvs, colors, index = [], [], [], [], []
    used: dict[int, int] = {}
    tinted: set[int] = set()
    problems, offset, colored = [], 0, False
    for piece in pieces:
        number = len(sources) - 1 if piece.material is None else piece.material
        source, faces = sources[number], piece.triangles
        if piece.uv is None and source.texture:
            raise HeadError(f"the textured material {quoted(source.name)} has no texture coordinates")
        corner_uv = np.zeros((len(faces), 3, 2), np.float32) if piece.uv is None else piece.uv[faces]
        if _is_clear(source, corner_uv, piece.color, textures):
            problems.append(f"the see-through material {quoted(source.name)} is left out")
            continue
        vertices.append(piece.vertices)
        triangles.append(faces + offset)
        offset += len(piece.vertices)
        uvs.append(corner_uv)
        colored |= piece.color is not None
        if source.note:
            problems.append(source.note)
        if piece.color is None and source.color is None and source.texture is None:
            problems.append(f"no texture or colour for {quoted(source.name)}; drawn as plain skin")
        colors.append(_vertex_colors(piece.color, source, len(piece.vertices)))
        if source.texture and (colors[-1] < WHITE).any():
            tinted.add(number)
        index.append(np.full(len(faces), used.setdefault(number, len(used)), dtype=np.int32))
    if not vertices:
        raise HeadError("the file has no triangles that can be seen")
    all_uv, all_index = np.concatenate(uvs).astype(np.float32), np.concatenate(index)
    materials = []
    for number, place in used.items():
        of_material = all_index == place
        material, all_uv[of_material], notes = _material(
            sources[number], number in tinted, all_uv[of_material], textures
        )
        materials.append(material)
        problems += notes
    needed = tinted or not all(m.texture for m in materials)
    return HeadMesh(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=all_uv if any(m.texture for m in materials) else None,
        vertex_colors=np.concatenate(colors) if colored and needed else None,
        material_index=all_index,
        materials=tuple(materials),
        problems=tuple(dict.fromkeys(problems)),
    )


def _is_clear(source: PieceMaterial, uv: np.ndarray, color: np.ndarray | None, textures: Textures) -> bool:
    """Is it a shell that a viewer looks through, such as a cornea or a film of tears?"""
    passes = source.transmission
    if passes > SEE_THROUGH and source.transmission_map:
        passes *= textures.mean_red(source.transmission_map, uv, source.wraps)
    if passes > SEE_THROUGH:
        return True
    if source.mode not in ("BLEND", "MASK"):
        return False
    opacity = source.opacity
    if source.texture:
        opacity *= textures.peak_alpha(source.texture, uv, source.wraps)
    if color is not None and color.shape[1:] == (4,) and len(color):
        opacity *= float(_fractions(color[:, 3]).max())
    return opacity < (source.cutoff if source.mode == "MASK" else SEE_THROUGH)


def _material(
    source: PieceMaterial, tinted: bool, uv: np.ndarray, textures: Textures
) -> tuple[Material, np.ndarray, list[str]]:
    """A material, the coordinates of its triangles in the image, and notes. tinted: by vertex colours."""
    material = Material(source.name, source.color or SKIN, source.texture)
    if source.texture is None:
        return material, uv, []
    red, green, blue = source.factor.tolist()
    material = replace(material, tint=(red, green, blue), vertex_tint=tinted)
    return textures.lay(material, uv, source.wraps, cut=source.mode != "OPAQUE")


def _vertex_colors(values: np.ndarray | None, source: PieceMaterial, count: int) -> np.ndarray:
    """sRGB of linear COLOR_0 times the base colour (glTF 2.0, 3.9.2); the base colour without COLOR_0.

    Of a textured material it is COLOR_0 alone, and 1 without it: the base colour is the texture's tint.
    """
    if values is None:
        plain = 1.0 if source.texture else source.color or SKIN
        return np.full((count, 3), plain, dtype=np.float32)
    color = _fractions(values[:, :3])
    return srgb(color if source.texture else color * source.factor)


def _fractions(values: np.ndarray) -> np.ndarray:
    return values / np.iinfo(values.dtype).max if np.issubdtype(values.dtype, np.integer) else values


def srgb(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 transfer of linear values, clipped to 0-1."""
    if not np.isfinite(linear).all():
        raise HeadError("a colour is not a finite number; export the mesh again")
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)


def linear(srgb_values: np.ndarray) -> np.ndarray:
    """The inverse of :func:`srgb`, of values clipped to 0-1."""
    x = np.clip(srgb_values, 0.0, 1.0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)

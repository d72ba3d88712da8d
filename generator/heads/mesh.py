# SPDX-License-Identifier: GPL-3.0-or-later
"""A head as plain arrays: what every source is read into and every renderer draws."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.heads.scene import BlendScene
from generator.heads.tiling import EXTEND
from generator.labels import SKIN


@dataclass(frozen=True)
class Material:
    """How a group of triangles is coloured.

    base_color: sRGB 0-1, used where there is neither texture nor vertex colour.
    texture: an image file on disk. cutout: its alpha channel makes holes
    (lashes, hair cards).
    tint: linear factors of the texture. vertex_tint: vertex colours are factors
    of the texture, too. wrap: how the texture goes on beyond 0-1, see
    :mod:`generator.heads.tiling`.
    label: what it is, of :data:`generator.labels.LABELS`. label_map: an image beside the texture, whose
    bytes say it texel by texel, as places in LABELS.
    gloss: 0 is matt, 1 reflects as glass or a wet eye does. opacity: share of what is behind that it hides,
    such as a lens of glasses.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    texture: Path | None = None
    cutout: bool = False
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vertex_tint: bool = False
    wrap: str = EXTEND
    label: str = SKIN
    label_map: Path | None = None
    gloss: float = 0.0
    opacity: float = 1.0


@dataclass(frozen=True)
class HeadMesh:
    """One head as a triangle mesh in its source's own units and axes.

    vertices         float64 [V, 3]; vertices are shared along texture seams,
                     so that normals are smooth across them
    triangles        int32 [T, 3], counter-clockwise seen from outside
    uv               float32 [T, 3, 2] per triangle corner, v up; None without texture
    vertex_colors    float32 [V, 3] sRGB 0-1; None where there are none
    material_index   int32 [T] into materials
    openness         float32 [V] 0-1, the light from everywhere that reaches a vertex; None where nobody
                     asked, see generator.landmarks.occlusion
    problems         what the reader noticed and could work around, a line each
    scene            where it stands in the Blender scene that it was read from; None for any other
    """

    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray | None
    vertex_colors: np.ndarray | None
    material_index: np.ndarray
    materials: tuple[Material, ...]
    problems: tuple[str, ...] = ()
    openness: np.ndarray | None = None
    scene: BlendScene | None = None

    def __post_init__(self) -> None:
        count, faces = len(self.vertices), len(self.triangles)
        if self.vertices.shape != (count, 3) or self.triangles.shape != (faces, 3) or not faces:
            raise HeadError("the mesh has no triangles")
        if not np.isfinite(self.vertices).all():
            raise HeadError("a vertex coordinate is not a finite number")
        if self.triangles.min() < 0 or self.triangles.max() >= count:
            raise HeadError(f"a triangle points to a vertex that does not exist (there are {count})")
        if self.uv is not None and self.uv.shape != (faces, 3, 2):
            raise HeadError("texture coordinates do not match the triangles")
        if self.vertex_colors is not None and self.vertex_colors.shape != (count, 3):
            raise HeadError("vertex colours do not match the vertices")
        if self.material_index.shape != (faces,) or not self.materials:
            raise HeadError("materials do not match the triangles")
        if self.material_index.min() < 0 or self.material_index.max() >= len(self.materials):
            raise HeadError("a triangle points to a material that does not exist")

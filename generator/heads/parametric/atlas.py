# SPDX-License-Identifier: GPL-3.0-or-later
"""The texture atlas: what every texel lies on, in the coordinates of the base mesh.

Paint is a function of the canonical point below a texel, so the same brow or
lip follows every shape that the template takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.spatial import cKDTree

from generator.heads.parametric.source import data_folder
from generator.heads.parametric.template import PARTS, HeadTemplate, head_template

ATLAS_SIZE = 1024
"""Texels along each side of skin.png."""

_OCCLUSION_RADIUS = 0.35


@dataclass(frozen=True)
class Atlas:
    """Per-texel facts, [H, W, ...], row 0 at the top of the image. Texels outside
    the islands repeat the nearest one, so that filtering never meets a border.

    points: float32 [H, W, 3] canonical position, dm
    part: int8 [H, W] into PARTS
    occlusion: 0 open to 1 closed in
    lid, lip_seam: distance to the edge of the lids, to the line between the lips, dm
    lips, ears: masks 0-1, from MakeHuman's CC0 masks
    """

    points: np.ndarray
    part: np.ndarray
    occlusion: np.ndarray
    lid: np.ndarray
    lip_seam: np.ndarray
    lips: np.ndarray
    ears: np.ndarray

    def is_part(self, *names: str) -> np.ndarray:
        """bool [H, W]."""
        return np.logical_or.reduce([self.part == PARTS.index(name) for name in names])


@lru_cache(maxsize=1)
def head_atlas() -> Atlas:
    """Rasterise the template into its texture. About two seconds, once a process."""
    template = head_template()
    triangle, weights = _rasterise(template.uv[template.triangle_uv], ATLAS_SIZE)
    outside = triangle < 0
    nearest = distance_transform_edt(outside, return_distances=False, return_indices=True)
    triangle, weights = triangle[tuple(nearest)], weights[tuple(nearest)]

    def blend(values: np.ndarray, corners: np.ndarray) -> np.ndarray:
        return np.einsum("hwk,hwk...->hw...", weights, values.astype(np.float32)[corners[triangle]])

    points = blend(template.canonical, template.triangles)
    source_uv = blend(template.source_uv, template.triangle_uv)
    part = template.part[triangle].astype(np.int8)
    flat = points.reshape(-1, 3)
    lid = cKDTree(_dense(template, template.lid_margin)).query(flat, distance_upper_bound=0.3)[0]
    lip = cKDTree(_dense(template, template.lip_margin)).query(flat, distance_upper_bound=0.8)[0]
    skin = part == PARTS.index("skin")
    return Atlas(
        points=points,
        part=part,
        occlusion=blend(_occlusion(template), template.triangles),
        lid=np.minimum(lid, 0.3).astype(np.float32).reshape(part.shape),
        lip_seam=np.minimum(lip, 0.8).astype(np.float32).reshape(part.shape),
        lips=_mask("lips", source_uv) * skin,
        ears=_mask("ears", source_uv) * skin,
    )


def _rasterise(corners: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangle index [size, size] (-1 outside) and barycentric weights [size, size, 3].

    corners: [T, 3, 2] atlas coordinates, v up.
    """
    triangle = np.full((size, size), -1, dtype=np.int32)
    weights = np.zeros((size, size, 3), dtype=np.float32)
    pixels = corners * size
    pixels = np.stack([pixels[..., 0], size - pixels[..., 1]], axis=-1) - 0.5
    low = np.maximum(np.ceil(pixels.min(1)).astype(int), 0)
    high = np.minimum(np.floor(pixels.max(1)).astype(int), size - 1)
    for k, ((ax, ay), (bx, by), (cx, cy)) in enumerate(pixels):
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        (x0, y0), (x1, y1) = low[k], high[k]
        if area == 0 or x1 < x0 or y1 < y0:
            continue
        x = np.arange(x0, x1 + 1)[None, :]
        y = np.arange(y0, y1 + 1)[:, None]
        second = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        third = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        inside = (second >= -1e-6) & (third >= -1e-6) & (second + third <= 1 + 1e-6)
        triangle[y0 : y1 + 1, x0 : x1 + 1][inside] = k
        weights[y0 : y1 + 1, x0 : x1 + 1][inside] = np.stack([1 - second - third, second, third], -1)[inside]
    return triangle, weights


def _dense(template: HeadTemplate, loop: np.ndarray) -> np.ndarray:
    """Points every quarter along the edges that join the loop's vertices, [K, 3]."""
    member = np.zeros(len(template.canonical), dtype=bool)
    member[loop] = True
    edges = np.concatenate([template.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    edges = edges[member[edges].all(1)]
    a, b = template.canonical[edges].transpose(1, 0, 2)
    return np.concatenate([a + (b - a) * t for t in (0, 0.25, 0.5, 0.75)])


def _occlusion(template: HeadTemplate) -> np.ndarray:
    """How closed in each vertex is, [V], 0-1: disks for vertices, as in
    Bunnell, "Dynamic ambient occlusion and indirect lighting", GPU Gems 2, 2005.
    """
    skin = template.triangles[template.part == PARTS.index("skin")]
    normals, areas = vertex_normals(template.canonical, skin)
    used = np.unique(skin)
    pairs = used[cKDTree(template.canonical[used]).query_pairs(_OCCLUSION_RADIUS, output_type="ndarray")]
    receiver, emitter = np.concatenate([pairs, pairs[:, ::-1]]).T
    way = template.canonical[emitter] - template.canonical[receiver]
    squared = (way**2).sum(1)
    way /= np.sqrt(np.maximum(squared, 1e-12))[:, None]
    received = np.einsum("ij,ij->i", normals[receiver], way)
    emitted = -np.einsum("ij,ij->i", normals[emitter], way)
    area = areas[emitter]
    share = area * np.maximum(received, 0) * np.maximum(emitted, 0) / (np.pi * squared + area)
    return np.clip(np.bincount(receiver, share, minlength=len(normals)), 0, 1)


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Area-weighted unit normals [V, 3] and a third of the surrounding area [V]; zero where unused."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a) / 2
    corner = triangles.ravel()
    per_corner = np.repeat(cross, 3, axis=0)
    count = len(vertices)
    sums = np.stack([np.bincount(corner, per_corner[:, k], minlength=count) for k in range(3)], axis=1)
    areas = np.bincount(corner, np.linalg.norm(per_corner, axis=1), minlength=count) / 3
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.divide(sums, length, out=np.zeros_like(sums), where=length > 0), areas


def _mask(name: str, source_uv: np.ndarray) -> np.ndarray:
    """MakeHuman's mask ``mpfb_<name>.jpg`` sampled at base-mesh coordinates, float32 0-1."""
    with Image.open(data_folder() / f"mpfb2/textures/mpfb_{name}.jpg") as image:
        pixels = np.asarray(image.convert("L"), dtype=np.float32) / 255
    height, width = pixels.shape
    rows = (1 - source_uv[..., 1]) * height - 0.5
    columns = source_uv[..., 0] * width - 0.5
    return map_coordinates(pixels, [rows, columns], order=1, mode="nearest")

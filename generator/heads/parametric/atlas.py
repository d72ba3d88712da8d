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
from generator.heads.triangles import vertex_normals

ATLAS_SIZE = 1024
"""Texels along each side of skin.png."""

ATLASES = 2
"""Of how many atlases paint keeps what it worked out, in one process."""

_OCCLUSION_RADIUS = 0.35
LID_REACH, LIP_REACH = 0.15, 0.2  # No paint looks farther.


@dataclass(frozen=True, eq=False)
class Atlas:
    """Per-texel facts, [H, W, ...], row 0 at the top of the image. Texels outside
    the islands repeat the nearest one, so that filtering never meets a border.
    What paint works out from them for every head is kept with the atlas, which is why one is equal
    to itself alone.

    points: float32 [H, W, 3] canonical position, dm
    part: int8 [H, W] into PARTS
    occlusion: 0 open to 1 closed in
    lid, lip_seam: distance to the edge of the lids, to the line between the lips, dm; at most 0.15 and 0.2
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

    def texels(self, where: np.ndarray) -> np.ndarray:
        """Canonical positions float32 [K, 3] at texels where [K], counted along the rows."""
        return self.points.reshape(-1, 3)[where]


@lru_cache(maxsize=1)
def head_atlas() -> Atlas:
    """Rasterise the template into its texture. Less than a second, once a process."""
    template = head_template()
    texels = texels_in_use(template.uv[template.triangle_uv])
    points = texels.blend(template.canonical, template.triangles)
    source_uv = texels.blend(template.source_uv, template.triangle_uv)
    part = template.part[texels.triangle].astype(np.int8)
    skin = part == PARTS.index("skin")
    lid, lips = (
        along_loop(template.canonical, template.triangles, loop)
        for loop in (template.lid_margin, template.lip_margin)
    )
    return texels.atlas(
        points=points,
        part=part,
        occlusion=texels.blend(_occlusion(template), template.triangles),
        lid=distance_to(lid, points, LID_REACH),
        lip_seam=distance_to(lips, points, LIP_REACH),
        lips=_mask("lips", source_uv) * skin,
        ears=_mask("ears", source_uv) * skin,
    )


@dataclass(frozen=True)
class Texels:
    """The K texels of an atlas that lie in a triangle, int [K]; weights float32 [K, 3] of its corners.

    nearest: of every texel [H, W] the place among them of the nearest one.
    """

    triangle: np.ndarray
    weights: np.ndarray
    nearest: np.ndarray

    def blend(self, values: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """float32 [K, ...]: values [N, ...] of vertices, which corners int [T, 3] name, at each texel."""
        values, column = values.astype(np.float32), (-1, *[1] * (values.ndim - 1))
        first, second, third = (
            values[corners[self.triangle, k]] * self.weights[:, k].reshape(column) for k in range(3)
        )
        return first + second + third

    def atlas(self, **facts: np.ndarray) -> Atlas:
        """An atlas of its fields as [K, ...]."""
        return Atlas(**{name: values[self.nearest] for name, values in facts.items()})


def texels_in_use(corners: np.ndarray) -> Texels:
    """The texels inside of triangles, whose corners are float [T, 3, 2] in the atlas, v up."""
    triangle, weights = _rasterise(corners, ATLAS_SIZE)
    inside = np.flatnonzero(triangle.ravel() >= 0)
    return Texels(triangle.ravel()[inside], weights.reshape(-1, 3)[inside], _nearest(inside, ATLAS_SIZE))


def _nearest(inside: np.ndarray, size: int) -> np.ndarray:
    """For every texel [size, size] the place in ``inside``, texels in use, of the nearest of them."""
    outside = np.ones((size, size), dtype=bool)
    outside.ravel()[inside] = False
    rows, columns = distance_transform_edt(outside, return_distances=False, return_indices=True)
    place = np.empty(size * size, dtype=np.int32)
    place[inside] = np.arange(len(inside))
    return place[rows * size + columns]


def distance_to(loop: np.ndarray, points: np.ndarray, limit: float) -> np.ndarray:
    """Distance of points [N, 3] to those of a loop [K, 3], at most limit, float32 [N]."""
    near = ((points > loop.min(0) - limit) & (points < loop.max(0) + limit)).all(1)
    distance = np.full(len(points), limit, dtype=np.float32)
    found = cKDTree(loop).query(points[near], distance_upper_bound=limit)[0]
    distance[near] = np.minimum(found, limit)
    return distance


def _rasterise(corners: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangle index [size, size] (-1 outside) and barycentric weights [size, size, 3].

    corners: [T, 3, 2] atlas coordinates, v up. Where triangles overlap the last one counts.
    """
    pixels = corners * size
    pixels = np.stack([pixels[..., 0], size - pixels[..., 1]], axis=-1) - 0.5
    low = np.maximum(np.ceil(pixels.min(1)).astype(int), 0)
    high = np.minimum(np.floor(pixels.max(1)).astype(int), size - 1)
    a, ab, ac = pixels[:, 0], pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    area = ab[:, 0] * ac[:, 1] - ac[:, 0] * ab[:, 1]
    width, height = np.maximum(high - low + 1, 0).T * (area != 0)
    drawn = np.flatnonzero(width * height)
    a, ab, ac, low, area, width, height = (x[drawn] for x in (a, ab, ac, low, area, width, height))
    # Every texel of every triangle's box, row by row; weights as affine functions of the place in the box.
    owner = np.repeat(np.arange(len(drawn)), width * height)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(width * height) - width * height, width * height)
    down, across = np.divmod(place, width[owner])
    texel = (low[:, 1] * size + low[:, 0])[owner] + down * size + across
    corner = low - a
    second, third = (
        (start[owner] + right[owner] * across + lower[owner] * down)
        for start, right, lower in (
            ((corner[:, 0] * ac[:, 1] - ac[:, 0] * corner[:, 1]) / area, ac[:, 1] / area, -ac[:, 0] / area),
            ((ab[:, 0] * corner[:, 1] - corner[:, 0] * ab[:, 1]) / area, -ab[:, 1] / area, ab[:, 0] / area),
        )
    )
    hit = (second >= -1e-6) & (third >= -1e-6) & (second + third <= 1 + 1e-6)
    texel, second, third = texel[hit], second[hit], third[hit]
    triangle = np.full(size * size, -1, dtype=np.int32)
    weights = np.zeros((size * size, 3), dtype=np.float32)
    triangle[texel] = drawn[owner[hit]]
    weights[texel] = np.stack([1 - second - third, second, third], axis=-1)
    return triangle.reshape(size, size), weights.reshape(size, size, 3)


def along_loop(points: np.ndarray, triangles: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Points every quarter along the edges that join a loop's vertices, [K, 3].

    points: [V, 3]. triangles: int [T, 3]. loop: int, vertices.
    """
    member = np.zeros(len(points), dtype=bool)
    member[loop] = True
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    edges = edges[member[edges].all(1)]
    a, b = points[edges].transpose(1, 0, 2)
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


def _mask(name: str, source_uv: np.ndarray) -> np.ndarray:
    """MakeHuman's mask ``mpfb_<name>.jpg`` sampled at base-mesh coordinates, float32 0-1."""
    with Image.open(data_folder() / f"mpfb2/textures/mpfb_{name}.jpg") as image:
        pixels = np.asarray(image.convert("L"), dtype=np.float32) / 255
    height, width = pixels.shape
    rows = (1 - source_uv[..., 1]) * height - 0.5
    columns = source_uv[..., 0] * width - 0.5
    return map_coordinates(pixels, [rows, columns], order=1, mode="nearest")

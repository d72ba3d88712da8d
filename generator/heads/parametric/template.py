# SPDX-License-Identifier: GPL-3.0-or-later
"""The head cut out of MakeHuman's base mesh: which vertices, which triangles, where in the texture.

Everything here is the same for every head and is built once a process. A head's
vertices are ``template.refine @ shape[template.source_vertices]`` - a linear map,
so one template serves every shape and every expression.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, vstack
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from generator.heads.parametric.source import BaseMesh, base_mesh
from generator.heads.parametric.subdivide import refine_quads

PARTS = ("skin", "mouth", "socket_left", "socket_right", "upper_teeth", "lower_teeth", "tongue", "lashes")
"""What a triangle belongs to, in the order of ``HeadTemplate.part``."""

COARSE_QUAD = 0.105
"""Outer quads with a longer edge (dm) are subdivided once: they make the outline of the skull."""

# Cells of the atlas (x, y, width, height), v up: the face and scalp fill the upper part.
_CELLS = {
    "skin": (0.0, 0.105, 1.0, 0.895),
    "neck": (0.60, 0.0, 0.40, 0.1),
    "mouth": (0.0, 0.0, 0.16, 0.1),
    "socket_left": (0.16, 0.0, 0.09, 0.1),
    "socket_right": (0.25, 0.0, 0.09, 0.1),
    "upper_teeth": (0.34, 0.05, 0.18, 0.05),
    "lower_teeth": (0.34, 0.0, 0.18, 0.05),
    "tongue": (0.52, 0.0, 0.08, 0.1),
}
_PADDING = 0.005


@dataclass(frozen=True)
class HeadTemplate:
    """Topology shared by all heads. V vertices, T triangles, U texture vertices.

    source_vertices  int64 [S], indices into MakeHuman's base mesh
    refine           sparse [V, S]: neck cut, subdivision of the skull, as a linear map
    canonical        float64 [V, 3] dm: the refined base mesh itself, where paint is defined
    triangles        int32 [T, 3]; triangle_uv int32 [T, 3] into uv
    uv, source_uv    float64 [U, 2], v up: in the atlas, and in MakeHuman's own layout
    part             int64 [T] into PARTS
    lid_margin, lip_margin  int64: vertices along the lids' edges and between the lips
    lash_vertices, lash_roots  int64 [L]: lash vertices and the lid vertex each grows from
    eye_vertices     (left, right) int64: MakeHuman's eye helpers in source numbering
    """

    source_vertices: np.ndarray
    refine: csr_matrix
    canonical: np.ndarray
    triangles: np.ndarray
    triangle_uv: np.ndarray
    uv: np.ndarray
    source_uv: np.ndarray
    part: np.ndarray
    lid_margin: np.ndarray
    lip_margin: np.ndarray
    lash_vertices: np.ndarray
    lash_roots: np.ndarray
    eye_vertices: tuple[np.ndarray, np.ndarray]


@lru_cache(maxsize=1)
def head_template() -> HeadTemplate:
    """Cut, refine and unwrap the head. About a second, once a process."""
    base = base_mesh()
    quads, quad_uv, part = _select(base)
    islands = _islands(quads, quad_uv, part, base)
    uv, corner_uv = _unwrap(quad_uv, islands, base.uv)  # [U, 4]: atlas and source coordinates

    eyes = tuple(np.unique(base.quads[base.group == f"helper-{side}-eye"]) for side in "lr")
    used = np.unique(np.concatenate([quads.ravel(), *eyes]))
    lookup = np.full(len(base.vertices), -1)
    lookup[used] = np.arange(len(used))
    quads = lookup[quads].astype(np.int64)

    cut = _neck_cut(quads, base.vertices[used])
    positions = cut @ base.vertices[used]
    fine = refine_quads(quads, corner_uv, uv, len(used), _coarse(positions[quads], part))
    refine = csr_matrix(fine.refine @ cut)
    canonical = refine @ base.vertices[used]
    triangles, triangle_uv, uv, part = fine.triangles, fine.triangle_uv, fine.uv, part[fine.face]
    solid = np.linalg.norm(
        np.cross(
            canonical[triangles[:, 1]] - canonical[triangles[:, 0]],
            canonical[triangles[:, 2]] - canonical[triangles[:, 0]],
        ),
        axis=1,
    )
    keep = solid > 1e-9
    triangles, triangle_uv, part = triangles[keep], triangle_uv[keep], part[keep]
    refine, triangles, triangle_uv, part = _close_neck(refine, triangles, triangle_uv, part, canonical)
    canonical = refine @ base.vertices[used]

    def vertices_of(*names: str) -> np.ndarray:
        return np.unique(triangles[np.isin(part, [PARTS.index(name) for name in names])])

    skin = vertices_of("skin")
    lid = np.intersect1d(skin, vertices_of("socket_left", "socket_right"))
    lashes = vertices_of("lashes")
    roots = lid[cKDTree(canonical[lid]).query(canonical[lashes])[1]]
    return HeadTemplate(
        source_vertices=used,
        refine=refine,
        canonical=canonical,
        triangles=triangles.astype(np.int32),
        triangle_uv=triangle_uv.astype(np.int32),
        uv=uv[:, :2],
        source_uv=uv[:, 2:],
        part=part,
        lid_margin=lid,
        lip_margin=np.intersect1d(skin, vertices_of("mouth")),
        lash_vertices=lashes,
        lash_roots=roots,
        eye_vertices=(lookup[eyes[0]], lookup[eyes[1]]),
    )


def neck_height(points: np.ndarray) -> np.ndarray:
    """Signed height above the plane that ends the neck, dm. [..., 3] base coordinates -> [...].

    The plane falls towards the front, and its sides turn up before the shoulders.
    """
    return (
        points[..., 1]
        - 6.0
        + 0.22 * (points[..., 2] - 0.3)
        - 0.3 * np.maximum(np.abs(points[..., 0]) - 0.5, 0.0)
    )


def _select(base: BaseMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    corners = base.vertices[base.quads]
    near = (np.abs(corners[..., 0]).max(1) < 1.05) & (corners[..., 1].min(1) > 5.5)
    body = (base.group == "body") & near & (neck_height(corners).max(1) > 0)
    part = np.full(len(base.quads), -1)
    part[body] = PARTS.index("skin")
    for name in ("upper_teeth", "lower_teeth", "tongue"):
        part[base.group == "helper-" + name.replace("_", "-")] = PARTS.index(name)
    part[np.char.find(base.group, "eyelashes") > 0] = PARTS.index("lashes")
    chosen = part >= 0
    return base.quads[chosen], base.quad_uv[chosen], part[chosen]


def _islands(quads: np.ndarray, quad_uv: np.ndarray, part: np.ndarray, base: BaseMesh) -> np.ndarray:
    """Cell name of every quad; sets the part of the mouth and socket quads in place."""
    edges = np.concatenate([quad_uv[:, [i, (i + 1) % 4]] for i in range(4)])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(base.uv),) * 2)
    label = connected_components(graph, directed=False)[1][quad_uv[:, 0]]
    names = np.array([PARTS[p] for p in part], dtype="U16")
    skin = part == PARTS.index("skin")
    for island in np.unique(label[skin]):
        members = skin & (label == island)
        centre = base.vertices[quads[members]].reshape(-1, 3)
        size = np.ptp(centre, axis=0)
        if size[1] > 1.5:
            continue  # face and scalp
        if centre[:, 1].min() > 7.0:
            name = "socket_left" if centre[:, 0].mean() > 0 else "socket_right"
        elif centre[:, 2].max() > 1.4:
            name = "mouth"
        else:
            names[members] = "neck"
            continue
        names[members] = name
        part[members] = PARTS.index(name)
    return names


def _unwrap(quad_uv: np.ndarray, names: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Atlas and source coordinates [U, 4], corner indices [F, 4]; lashes share one point."""
    used, corner = np.unique(quad_uv, return_inverse=True)
    corner = corner.reshape(quad_uv.shape)
    atlas = np.zeros((len(used), 2))
    source = uv[used][:, ::-1] * [1.0, -1.0]  # MakeHuman's face lies on its side
    for name, (x, y, width, height) in _CELLS.items():
        members = np.unique(corner[names == name])
        points = source[members]
        if name == "skin":
            # Features get the texels: density falls off away from eyes, nose and mouth.
            points = np.arcsinh((points - [0.4832, -0.872]) / [0.03, 0.05])
        low, span = points.min(0), np.ptp(points, axis=0)
        free = np.array([width, height]) - 2 * _PADDING
        atlas[members] = np.array([x, y]) + _PADDING + (points - low) / span * free
    return np.concatenate([atlas, uv[used]], axis=1), corner


def _neck_cut(quads: np.ndarray, vertices: np.ndarray) -> csr_matrix:
    """Linear map that slides the vertices below the neck plane up their edges onto it."""
    height = neck_height(vertices)
    edges = np.unique(np.sort(np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)]), axis=1), axis=0)
    edges = np.concatenate([edges, edges[:, ::-1]])
    below, above = edges[(height[edges[:, 0]] < 0) & (height[edges[:, 1]] >= 0)].T
    share = height[below] / (height[below] - height[above])  # of the upper vertex
    count = np.bincount(below, minlength=len(vertices))
    moved = count > 0
    stay = np.flatnonzero(~moved)
    rows = np.concatenate([stay, below, below])
    columns = np.concatenate([stay, above, below])
    weight = np.concatenate([np.ones(len(stay)), share / count[below], (1 - share) / count[below]])
    cut = csr_matrix((weight, (rows, columns)), shape=(len(vertices),) * 2)
    # A quad with one corner above: its far corner has no edge upwards and takes its neighbours' place.
    tree = cKDTree(vertices[moved])
    ids = np.flatnonzero(moved)
    skin_bottom = np.flatnonzero((height < 0) & ~moved & np.isin(np.arange(len(vertices)), quads))
    if len(skin_bottom):
        swap = np.arange(len(vertices))
        swap[skin_bottom] = ids[tree.query(vertices[skin_bottom])[1]]
        cut = cut[swap]
    return cut


def _coarse(corners: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Which quads to refine, from their corners [F, 4, 3]: skull, ears' surroundings and nape."""
    longest = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(1)
    centre = corners.mean(1)
    away = (centre[:, 2] < 0.9) | (centre[:, 1] > 7.9)
    return (part == PARTS.index("skin")) & (longest > COARSE_QUAD) & away


def _close_neck(
    refine: csr_matrix,
    triangles: np.ndarray,
    triangle_uv: np.ndarray,
    part: np.ndarray,
    canonical: np.ndarray,
) -> tuple[csr_matrix, np.ndarray, np.ndarray, np.ndarray]:
    """A fan over the open end of the neck, so that no pose looks into the head."""
    skin = np.flatnonzero(part == PARTS.index("skin"))
    edges = np.concatenate([triangles[skin][:, [i, (i + 1) % 3]] for i in range(3)])
    edge_uv = np.concatenate([triangle_uv[skin][:, [i, (i + 1) % 3]] for i in range(3)])
    count = len(canonical)
    low = canonical[edges].mean(1)[:, 1] < 6.4
    rim = np.flatnonzero(low & ~np.isin(edges[:, 1] * count + edges[:, 0], edges[:, 0] * count + edges[:, 1]))
    centre = refine.shape[0]
    loop = np.unique(edges[rim])
    mean = csr_matrix(refine[loop].mean(axis=0))
    fan = np.stack([edges[rim][:, 1], edges[rim][:, 0], np.full(len(rim), centre)], axis=1)
    fan_uv = np.stack([edge_uv[rim][:, 1], edge_uv[rim][:, 0], edge_uv[rim][:, 0]], axis=1)
    return (
        csr_matrix(vstack([refine, mean])),
        np.concatenate([triangles, fan]),
        np.concatenate([triangle_uv, fan_uv]),
        np.concatenate([part, np.full(len(rim), PARTS.index("skin"))]),
    )

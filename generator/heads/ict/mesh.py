# SPDX-License-Identifier: GPL-3.0-or-later
"""What of ICT-FaceKit's mesh is drawn: its triangles by part, and where each lies in our textures.

All heads share it. The shells before the eyes are clear and left out (tear fluid, the blend and the shadow
along the lids), and so are the irises, which lie within: the eyes' white, which goes on over the cornea,
is painted whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.ict.source import ADDRESS, NEUTRAL_FILE, FaceKit, read_facekit
from generator.heads.triangles import of_polygons

PARTS = (
    "skin", "mouth", "socket_left", "socket_right", "gums", "teeth", "lashes", "eye_left", "eye_right",
)  # fmt: skip
"""What a triangle belongs to, in the order of ``IctMesh.part``."""

_SKIN, _BACK = "M_Face", "M_BackHead"
_PART_OF = {
    _SKIN: "skin",
    _BACK: "skin",
    "M_GumsTongue": "gums",
    "M_Teeth": "teeth",
    "M_EyeLashes": "lashes",
    "M_ScleraLeft": "eye_left",
    "M_ScleraRight": "eye_right",
}
LEFT_OUT = ("M_LacrimalFluid", "M_EyeBlend", "M_EyeOcclusion", "M_IrisLeft", "M_IrisRight")

# Cells of the atlas (x, y, width, height), v up.
_CELLS = {
    "face": (0.0, 0.30, 1.0, 0.70),
    "back": (0.0, 0.0, 0.64, 0.30),
    "mouth": (0.64, 0.15, 0.18, 0.15),
    "socket_left": (0.82, 0.15, 0.09, 0.15),
    "socket_right": (0.91, 0.15, 0.09, 0.15),
    "gums": (0.64, 0.0, 0.18, 0.15),
    "teeth": (0.82, 0.0, 0.18, 0.15),
}
_PADDING = 0.005
_FEATURES = (0.5, 0.62), (0.22, 0.40)
"""Of the face's own coordinates: where its features are, and how fast texels get fewer away from there."""

_EYE_REACH = np.deg2rad(100)
"""From the axis of an eye to the border of eye.png, as ``paint_eye`` has it."""

_MAX_COVER = 16.0
"""Of the boxes about all triangles, in areas of the atlas; the published ones have 2.8."""

_MAX_PIECES = 200
"""Of the back of the head, and of lashes."""


@dataclass(frozen=True)
class IctMesh:
    """Topology of every head, V vertices, T triangles, U texture vertices.

    vertices       int64 [V - 1] of the neutral mesh; one more closes the neck, amid the vertices rim
    neutral        float64 [V, 3] cm, frame U
    triangles      int32 [T, 3]; corners int32 [T, 3] into uv
    uv             float64 [U, 2], v up: of skin in skin.png, of eyes in eye.png, of lashes in lash.png
    part           int64 [T] into PARTS
    rim            int64: vertices around the open end of the neck
    lid_margin, lip_margin  int64: vertices along the lids' edges and between the lips
    eyes           (left, right) int64: vertices of each eyeball
    landmarks      int64 [68]
    """

    vertices: np.ndarray
    neutral: np.ndarray
    triangles: np.ndarray
    corners: np.ndarray
    uv: np.ndarray
    part: np.ndarray
    rim: np.ndarray
    lid_margin: np.ndarray
    lip_margin: np.ndarray
    eyes: tuple[np.ndarray, np.ndarray]
    landmarks: np.ndarray

    def of_part(self, *names: str) -> np.ndarray:
        """bool [T]."""
        return np.isin(self.part, [PARTS.index(name) for name in names])

    def close(self, moved: np.ndarray) -> np.ndarray:
        """Vertices [V, 3] from those of the source [V - 1, 3]: with the one that closes the neck."""
        return np.concatenate([moved, moved[self.rim].mean(0, keepdims=True)])


@lru_cache(maxsize=1)
def ict_mesh(folder: Path) -> IctMesh:
    """The mesh of a folder's copy, once a process. Raises HeadError: it is not as published."""
    try:
        return _mesh(read_facekit(folder))
    except _UnlikeError as error:
        raise HeadError(f"{folder / NEUTRAL_FILE}: {error}; take ICT-FaceKit as {ADDRESS} has it") from error


class _UnlikeError(Exception):
    """What is not as in ICT-FaceKit."""


def _mesh(kit: FaceKit) -> IctMesh:
    faces, faces_uv, material = _triangles(kit)
    names = list(kit.mesh.materials)
    if missing := [name for name in _PART_OF if name not in names]:
        raise _UnlikeError(f"has no faces of the material {quoted(missing[0])}")
    known = np.array([PARTS.index(_PART_OF[name]) if name in _PART_OF else -1 for name in names])
    part = known[material]
    taken = part >= 0
    faces, faces_uv, material, part = faces[taken], faces_uv[taken], material[taken], part[taken]
    back = material == names.index(_BACK)
    _name_sockets(part, faces, back, kit.neutral)
    first = _first_of_same(kit)
    faces, landmarks = first[faces], first[kit.landmarks]
    whole = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(1)
    faces, faces_uv, back, part = faces[whole], faces_uv[whole], back[whole], part[whole]
    uv, corners = _unwrap(faces, faces_uv, back, part, kit)
    flat = np.isin(part, [PARTS.index(name) for name in (*_CELLS, "skin") if name in PARTS])
    if np.ptp(uv[corners[flat]], axis=1).prod(axis=1).sum() > _MAX_COVER:
        raise _UnlikeError("its texture coordinates lie over each other")

    used = np.unique(np.concatenate([faces.ravel(), landmarks]))
    lookup = np.full(len(kit.neutral), -1)
    lookup[used] = np.arange(len(used))
    faces = lookup[faces]
    points = kit.neutral[used]

    def vertices_of(*wanted: str) -> np.ndarray:
        return np.unique(faces[np.isin(part, [PARTS.index(name) for name in wanted])])

    skin = vertices_of("skin")
    rim, cap = _neck(faces[part == PARTS.index("skin")], points, len(points))
    corner_of = np.zeros(len(points) + 1, dtype=corners.dtype)
    corner_of[faces[part == PARTS.index("skin")]] = corners[part == PARTS.index("skin")]
    corner_of[-1] = corner_of[rim[0]]
    mesh = IctMesh(
        vertices=used,
        neutral=np.concatenate([points, points[rim].mean(0, keepdims=True)]),
        triangles=np.concatenate([faces, cap]).astype(np.int32),
        corners=np.concatenate([corners, corner_of[cap]]).astype(np.int32),
        uv=uv,
        part=np.concatenate([part, np.full(len(cap), PARTS.index("skin"))]),
        rim=rim,
        lid_margin=np.intersect1d(skin, vertices_of("socket_left", "socket_right")),
        lip_margin=np.intersect1d(skin, vertices_of("mouth")),
        eyes=(vertices_of("eye_left"), vertices_of("eye_right")),
        landmarks=lookup[landmarks],
    )
    for what, loop in (("eyes", mesh.lid_margin), ("mouth", mesh.lip_margin)):
        if not len(loop):
            raise _UnlikeError(f"the skin has no opening for the {what}")
    mesh.uv[:] = _lay_lashes(mesh)
    return mesh


def _triangles(kit: FaceKit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and texture vertices int64 [T, 3] from 0 on, and int64 [T] materials."""
    mesh = kit.mesh
    corners, face = of_polygons(np.frombuffer(mesh.face_corners, dtype=np.int32).astype(np.int64))
    position = np.frombuffer(mesh.corner_position, dtype=np.int32)[corners].astype(np.int64) - 1
    uv = np.frombuffer(mesh.corner_uv, dtype=np.int32)[corners].astype(np.int64) - 1
    if position.max() >= len(kit.neutral):
        raise _UnlikeError(f"a face uses a vertex outside of 1 to {len(kit.neutral)}")
    table = mesh.table(mesh.uvs, 2)
    if uv.min() < 0 or uv.max() >= len(table) or not np.isfinite(table).all():
        raise _UnlikeError("a face has no texture coordinates")
    return position, uv, np.frombuffer(mesh.face_material, dtype=np.int32)[face].astype(np.int64)


def _first_of_same(kit: FaceKit) -> np.ndarray:
    """For every vertex, int64 [V], the first that lies where it does in all modes: seams that are none."""
    _, label = np.unique(kit.neutral.round(5), axis=0, return_inverse=True)
    label = label.ravel()
    order = np.argsort(label, kind="stable")
    leader = order[np.searchsorted(label[order], label)]
    others = np.flatnonzero(leader != np.arange(len(label)))
    apart = np.abs(kit.modes[:, others] - kit.modes[:, leader[others]]).max(axis=(0, 2), initial=0) > 1e-4
    leader[others[apart]] = others[apart]
    return leader


def components(faces: np.ndarray) -> np.ndarray:
    """Number of the connected piece that each face belongs to, int [F], from faces int [F, 3]."""
    used, small = np.unique(faces, return_inverse=True)
    small = small.reshape(faces.shape)
    edges = np.concatenate([small[:, [0, 1]], small[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(used),) * 2)
    count, label = connected_components(graph, directed=False)
    if count > _MAX_PIECES:
        raise _UnlikeError(f"{count} pieces where ICT-FaceKit has a few")
    return label[small[:, 0]]


def _name_sockets(part: np.ndarray, faces: np.ndarray, back: np.ndarray, points: np.ndarray) -> None:
    """Tell mouth and sockets, which have the material of the back of the head, from skin, in part."""
    rows = np.flatnonzero(back)
    piece = components(faces[rows])
    boxes = [np.ptp(points[faces[rows[piece == k]]].reshape(-1, 3), axis=0) for k in range(piece.max() + 1)]
    sizes = np.max(boxes, axis=1)
    for k in np.flatnonzero(sizes < 0.6 * sizes.max()):
        members = rows[piece == k]
        across = points[faces[members]].reshape(-1, 3)[:, 0]
        if across.min() < 0 < across.max():
            name = "mouth"
        else:
            name = "socket_left" if across.mean() > 0 else "socket_right"
        part[members] = PARTS.index(name)


def _unwrap(
    faces: np.ndarray, faces_uv: np.ndarray, back: np.ndarray, part: np.ndarray, kit: FaceKit
) -> tuple[np.ndarray, np.ndarray]:
    """Our texture coordinates [U, 2], and corners [T, 3] into them.

    A texture vertex serves one cell: numbers beyond those of the source tell cells apart that share one.
    """
    cell = np.array(PARTS, dtype="U16")[part]
    cell[(cell == "skin") & back] = "back"
    cell[cell == "skin"] = "face"
    order = ["face", "back", *PARTS[1:]]
    key = np.array([order.index(name) for name in cell])[:, None] * (1 << 32)
    # An eye has a texture vertex a vertex, about the axis.
    corner = np.where(np.isin(cell, ["eye_left", "eye_right"])[:, None], faces, faces_uv)
    used, corners = np.unique(key + corner, return_inverse=True)
    corners = corners.reshape(faces.shape)
    owner, number = used >> 32, used & ((1 << 32) - 1)
    source = kit.mesh.table(kit.mesh.uvs, 2)
    uv = np.zeros((len(used), 2))
    for index, name in enumerate(order):
        rows = owner == index
        if name.startswith("eye"):
            uv[rows] = _around_axis(kit.neutral[number[rows]])
            continue
        points = source[number[rows]]
        if name not in _CELLS:
            uv[rows] = points  # lashes, laid later
            continue
        if name == "face":
            centre, fall = _FEATURES
            points = np.arcsinh((points - centre) / np.array(fall))
        x, y, width, height = _CELLS[name]
        span = np.maximum(np.ptp(points, axis=0), 1e-9) if len(points) else 1.0
        free = np.array([width, height]) - 2 * _PADDING
        uv[rows] = np.array([x, y]) + _PADDING + (points - points.min(0, initial=np.inf)) / span * free
    return uv, corners


def eye_frame(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre [3] and axis [3] of an eyeball of vertices [K, 3], which looks along +z or nearly so.

    Width and height give the radius, the back the depth; the cornea stands out along the axis.
    """
    low, high = points.min(0), points.max(0)
    centre = (low + high) / 2
    radius = (high - low)[:2].mean() / 2
    centre[2] = low[2] + radius
    away = points - centre
    front = away[:, 2] > 0.8 * radius
    proud = np.maximum(np.linalg.norm(away, axis=1) - 1.01 * radius, 0) * front
    axis = proud @ away + np.array([0, 0, 1e-9])
    return centre, axis / np.linalg.norm(axis)


def _around_axis(points: np.ndarray) -> np.ndarray:
    """Azimuthal equidistant coordinates [K, 2] of an eyeball, as its picture is painted."""
    centre, axis = eye_frame(points)
    away = points - centre
    across = np.cross([0.0, 1.0, 0.0], axis)
    across /= np.linalg.norm(across)
    right, up, front = away @ across, away @ np.cross(axis, across), away @ axis
    side = np.hypot(right, up)
    reach = 0.5 * np.minimum(np.arctan2(side, front) / _EYE_REACH, 1) / np.maximum(side, 1e-9)
    return 0.5 + np.stack([right * reach, up * reach], axis=1)


def _lay_lashes(mesh: IctMesh) -> np.ndarray:
    """uv with every lash card laid over the whole of lash.png, roots below."""
    uv = mesh.uv.copy()
    rows = np.flatnonzero(mesh.of_part("lashes"))
    lids = cKDTree(mesh.neutral[mesh.lid_margin])
    piece = components(mesh.corners[rows])  # cards may touch, not so in the texture
    for k in range(piece.max() + 1):
        card = rows[piece == k]
        corners, first = np.unique(mesh.corners[card].ravel(), return_index=True)
        points = uv[corners] - uv[corners].min(0)
        points /= np.maximum(points.max(0), 1e-9)
        away = lids.query(mesh.neutral[mesh.triangles[card].ravel()[first]])[0]
        if (points[:, 1] - points[:, 1].mean()) @ away < 0:
            points[:, 1] = 1 - points[:, 1]
        uv[corners] = points
    return uv


def _neck(skin: np.ndarray, points: np.ndarray, centre: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices around the open end of the neck, and a fan [K, 3] over it: no pose looks into the head."""
    edges = np.concatenate([skin[:, [i, (i + 1) % 3]] for i in range(3)])
    seen = set(map(tuple, edges.tolist()))
    open_edges = np.array([(a, b) for a, b in edges.tolist() if (b, a) not in seen]).reshape(-1, 2)
    height = points[skin, 1]
    low = points[open_edges].mean(1)[:, 1] < height.min() + 0.25 * np.ptp(height)
    around = open_edges[low]
    if not len(around):
        raise _UnlikeError("the neck has no open end")
    fan = np.stack([around[:, 1], around[:, 0], np.full(len(around), centre)], axis=1)
    return np.unique(around), fan

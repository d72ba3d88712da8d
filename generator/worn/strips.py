# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks of hair as tapered strips, and pieces of what is worn put together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from generator.heads.mesh import HeadMesh, Material


class Piece(NamedTuple):
    """Triangles of one material: vertices float64 [V, 3] mm, triangles int [T, 3], colors [V, 3] sRGB 0-1."""

    vertices: np.ndarray
    triangles: np.ndarray
    colors: np.ndarray


def join(pieces: Sequence[Piece]) -> Piece:
    """Pieces of one material as one."""
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces[:-1])])
    return Piece(
        np.concatenate([piece.vertices for piece in pieces]),
        np.concatenate([piece.triangles + start for piece, start in zip(pieces, starts, strict=True)]),
        np.concatenate([piece.colors for piece in pieces]),
    )


def worn_mesh(*parts: tuple[Material, Piece]) -> HeadMesh:
    """What a maker returns: a piece a material."""
    whole = join([piece for _, piece in parts])
    index = np.repeat(np.arange(len(parts)), [len(piece.triangles) for _, piece in parts])
    return HeadMesh(
        vertices=whole.vertices,
        triangles=whole.triangles.astype(np.int32),
        uv=None,
        vertex_colors=np.clip(whole.colors, 0, 1).astype(np.float32),
        material_index=index.astype(np.int32),
        materials=tuple(material for material, _ in parts),
    )


def strips(
    paths: np.ndarray, sides: np.ndarray, widths: np.ndarray, colors: np.ndarray, streak: np.ndarray
) -> Piece:
    """Strips that end in a tip, two triangles a step, N of K points each.

    paths: float64 [N, K, 3]. sides: unit vectors across, [N, K, 3] . widths: mm, [N, K]; the last is not
    used. colors: sRGB along each, [N, K, 3]. streak: factors of the colour at both edges, [N, 2].
    """
    count, steps = paths.shape[:2]
    half = 0.5 * widths[:, :-1, None] * sides[:, :-1]
    body = paths[:, :-1]
    # An edge's colours are its own: strips side by side look like strands.
    edges = np.stack([body - half, body + half], axis=2).reshape(count, -1, 3)
    shades = (colors[:, :-1, None] * streak[:, None, :, None]).reshape(count, -1, 3)
    vertices = np.concatenate([edges, paths[:, -1:]], axis=1)
    tips = colors[:, -1:] * streak.mean(axis=1)[:, None, None]
    k = 2 * np.arange(steps - 2)
    quads = np.stack([k, k + 1, k + 3, k, k + 3, k + 2], axis=1).reshape(-1, 3)
    end = 2 * (steps - 1)
    one = np.concatenate([quads, [[end - 2, end - 1, end]]])
    triangles = one[None] + (np.arange(count) * (end + 1))[:, None, None]
    return Piece(
        vertices.reshape(-1, 3),
        triangles.reshape(-1, 3),
        np.concatenate([shades, tips], axis=1).reshape(-1, 3),
    )


def across(paths: np.ndarray, normals: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Unit vectors across strips that lie on a surface, turned about their direction by roll [N, K], radians.

    paths, normals: float64 [N, K, 3].
    """
    along = np.gradient(paths, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9)
    side = np.cross(along, normals)
    length = np.linalg.norm(side, axis=2, keepdims=True)
    # A strip that stands up has any side.
    other = np.cross(along, np.broadcast_to([0.31, 0.27, 0.91], along.shape))
    side = np.where(length > 0.15, side, other)
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-9)
    up = np.cross(side, along)
    return side * np.cos(roll)[..., None] + up * np.sin(roll)[..., None]


def resample(paths: np.ndarray, lengths: np.ndarray, points: int, bias: float = 1.0) -> np.ndarray:
    """The first so many mm of each path as some points: float64 [N, points, 3]; above a bias of 1 they are
    denser at the root.

    paths: float64 [N, K, 3]. lengths: [N].
    """
    steps = np.linalg.norm(np.diff(paths, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(paths), 1)), np.cumsum(steps, axis=1)], axis=1)
    wanted = np.minimum(lengths, along[:, -1])[:, None] * np.linspace(0, 1, points) ** bias
    place = (along[:, None, :] <= wanted[:, :, None]).sum(axis=2) - 1
    place = np.clip(place, 0, paths.shape[1] - 2)
    rows = np.arange(len(paths))[:, None]
    share = (wanted - along[rows, place]) / np.maximum(steps[rows, place], 1e-9)
    return paths[rows, place] + share[..., None] * (paths[rows, place + 1] - paths[rows, place])

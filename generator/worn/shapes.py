# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes that things are put together from: sweeps, lathes, shells and balls, as triangles.

All is in the frame and the unit of the points that are given; closed shapes have outward normals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from generator.heads.mesh import HeadMesh, Material

CREASE_DEG = 42.0
"""An edge that is sharper than this is not shaded as if it were round."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles. vertices: float64 [V, 3]. triangles: int [T, 3], counter-clockwise from outside."""

    vertices: np.ndarray
    triangles: np.ndarray

    @cached_property
    def creased(self) -> tuple[Shape, np.ndarray]:
        """The shape with its sharp edges split, and of which old vertex each new one is, int [V]."""
        corners = self.vertices[self.triangles]
        normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        count = len(self.triangles)
        number = np.arange(3 * count).reshape(count, 3)
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
        of_corner = np.stack([number, np.roll(number, -1, axis=1)], axis=-1).reshape(-1, 2)
        swap = ends[:, 0] > ends[:, 1]
        ends[swap], of_corner[swap] = ends[swap, ::-1], of_corner[swap, ::-1]
        order = np.argsort(ends[:, 0].astype(np.int64) * len(self.vertices) + ends[:, 1], kind="stable")
        ends, of_corner, face = ends[order], of_corner[order], (np.arange(3 * count) // 3)[order]
        same = (ends[1:] == ends[:-1]).all(axis=1)
        smooth = same & ((normals[face[1:]] * normals[face[:-1]]).sum(1) > np.cos(np.radians(CREASE_DEG)))
        one, other = of_corner[:-1][smooth].ravel(), of_corner[1:][smooth].ravel()
        links = coo_matrix((np.ones(len(one)), (one, other)), shape=(3 * count, 3 * count))
        _, label = connected_components(links, directed=False)
        _, first, triangles = np.unique(label, return_index=True, return_inverse=True)
        origin = self.triangles.ravel()[first]
        return Shape(self.vertices[origin], triangles.reshape(count, 3)), origin


@dataclass(frozen=True, eq=False)
class Part:
    """A shape of one material. colors: sRGB 0-1, float [3], or float [V, 3] of the shape's vertices."""

    shape: Shape
    colors: np.ndarray | tuple[float, float, float]
    material: Material


def assemble(parts: Sequence[Part]) -> HeadMesh:
    """Parts as one mesh, their sharp edges split. Vertices have their colours."""
    vertices, triangles, colors, numbers = [], [], [], []
    materials: list[Material] = []
    start = 0
    for part in parts:
        shape, origin = part.shape.creased
        of_part = np.broadcast_to(np.asarray(part.colors, dtype=np.float32), part.shape.vertices.shape)
        if part.material not in materials:
            materials.append(part.material)
        vertices.append(shape.vertices)
        triangles.append(shape.triangles + start)
        colors.append(of_part[origin])
        numbers.append(np.full(len(shape.triangles), materials.index(part.material), dtype=np.int32))
        start += len(shape.vertices)
    return HeadMesh(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=None,
        vertex_colors=np.clip(np.concatenate(colors), 0, 1).astype(np.float32),
        material_index=np.concatenate(numbers),
        materials=tuple(materials),
    )


def unit(vectors: np.ndarray) -> np.ndarray:
    """Of length 1, along the last axis; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length == 0, 1, length)


def curve(points: Sequence[Sequence[float]] | np.ndarray, count: int, closed: bool = False) -> np.ndarray:
    """A smooth curve through points [M, D], float64 [count, D], evenly by their distance."""
    knots = np.asarray(points, dtype=np.float64)
    if closed:
        knots = np.vstack([knots, knots[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    spline = CubicSpline(along, knots, bc_type="periodic" if closed else "natural")
    return spline(np.linspace(0, along[-1], count, endpoint=not closed))


def lattice(points: np.ndarray, *, around: bool = False, along: bool = False) -> Shape:
    """A surface through rows of points, float [M, N, 3]. Seen with rows upwards and columns to the right it
    faces the viewer. around: the last column meets the first; along: the last row meets the first."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    if around:
        index = np.hstack([index, index[:, :1]])
    if along:
        index = np.vstack([index, index[:1]])
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Shape(points.reshape(-1, 3), triangles)


def closed_lattice(points: np.ndarray, *, along: bool = False) -> Shape:
    """Rings of points, float [M, N, 3], as a closed body: its ends are filled, unless the last ring meets
    the first (along)."""
    shape = lattice(points, around=True, along=along)
    if along:
        return outward(shape)
    rows, columns = points.shape[:2]
    ends = points[[0, -1]].mean(axis=1)
    first, last = np.arange(columns), (rows - 1) * columns + np.arange(columns)
    count = rows * columns
    caps = [
        np.stack([np.full(columns, count), np.roll(first, -1), first], axis=1),
        np.stack([np.full(columns, count + 1), last, np.roll(last, -1)], axis=1),
    ]
    return outward(Shape(np.vstack([shape.vertices, ends]), np.vstack([shape.triangles, *caps])))


def outward(shape: Shape) -> Shape:
    """A closed shape, turned inside out where its volume is negative."""
    a, b, c = (shape.vertices[shape.triangles[:, k]] - shape.vertices.mean(axis=0) for k in range(3))
    if (a * np.cross(b, c)).sum() >= 0:
        return shape
    return Shape(shape.vertices, shape.triangles[:, ::-1])


def sweep(path: np.ndarray, profile: np.ndarray, up: np.ndarray, *, closed: bool = False) -> Shape:
    """A profile along a path.

    path: float [N, 3]. profile: float [K, 2] or [N, K, 2]: first across the path and at right angles to up,
    then along up. up: float [3] or [N, 3]; of it counts what is at right angles to the path.
    """
    path = np.asarray(path, dtype=np.float64)
    if closed:
        tangent = unit(np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0))
    else:
        tangent = unit(np.gradient(path, axis=0))
    up = np.broadcast_to(np.asarray(up, dtype=np.float64), path.shape)
    second = unit(up - (up * tangent).sum(1, keepdims=True) * tangent)
    first = np.cross(second, tangent)
    profile = np.broadcast_to(profile, (len(path), *np.shape(profile)[-2:]))
    rings = path[:, None] + profile[..., :1] * first[:, None] + profile[..., 1:] * second[:, None]
    return closed_lattice(rings, along=closed)


def circle(radius: float = 1.0, count: int = 8) -> np.ndarray:
    """A profile, float64 [count, 2]."""
    turn = np.arange(count) * 2 * np.pi / count
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def bar(width: float, height: float, rounding: float = 0.5) -> np.ndarray:
    """A rectangle with its corners cut, float64 [8, 2]. rounding: share of the shorter half that is cut."""
    cut = rounding * min(width, height) / 2
    w, h = width / 2, height / 2
    corner = [(w, h - cut), (w - cut, h)]
    quarter = np.array(corner)
    return np.vstack(
        [quarter, quarter[::-1] * [-1, 1], quarter * [-1, -1], quarter[::-1] * [1, -1]],
    )


def limb(
    path: np.ndarray,
    radii: np.ndarray | float,
    count: int = 10,
    flat: float = 1.0,
    up: np.ndarray | None = None,
) -> Shape:
    """A round sweep with round ends. path: float [N, 3]. radii: of each of its points. flat: its height over
    its width, along up."""
    path = np.asarray(path, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radii, dtype=np.float64), len(path))
    fall = np.radians([80, 55, 25])
    start, end = unit(path[1] - path[0]), unit(path[-1] - path[-2])
    before = path[0] - radii[0] * np.sin(fall)[:, None] * start
    behind = path[-1] + radii[-1] * np.sin(fall[::-1])[:, None] * end
    full = np.concatenate([before, path, behind])
    full_radii = np.concatenate([radii[0] * np.cos(fall), radii, radii[-1] * np.cos(fall[::-1])])
    profile = circle(1.0, count)[None] * full_radii[:, None, None] * [1, flat]
    return sweep(full, profile, _steady_up(full) if up is None else up)


def ball(centre: np.ndarray, radii: np.ndarray, axes: np.ndarray | None = None, count: int = 12) -> Shape:
    """An ellipsoid. radii: float [3], along the columns of axes [3, 3]."""
    turn = np.arange(count) * 2 * np.pi / count
    fall = np.linspace(-np.pi / 2, np.pi / 2, count // 2 + 1)[1:-1]
    rings = np.stack(
        [
            np.cos(fall)[:, None] * np.cos(turn),
            np.cos(fall)[:, None] * np.sin(turn),
            np.broadcast_to(np.sin(fall)[:, None], (len(fall), count)),
        ],
        axis=-1,
    )
    shape = closed_lattice(rings)
    vertices = shape.vertices.copy()
    vertices[-2:] = [[0, 0, -1], [0, 0, 1]]
    turned = vertices * radii @ (np.eye(3) if axes is None else axes).T
    return outward(Shape(turned + centre, shape.triangles))


def lathe(outline: np.ndarray, centre: np.ndarray, axes: np.ndarray, count: int = 24) -> Shape:
    """A body of revolution. outline: float [M, 2], radius and height, from end to end. axes: float [3, 3],
    columns: two across and the axis."""
    turn = np.arange(count) * 2 * np.pi / count
    around = np.cos(turn)[:, None] * axes[:, 0] + np.sin(turn)[:, None] * axes[:, 1]
    outline = np.asarray(outline, dtype=np.float64)
    rings = outline[:, None, :1] * around + outline[:, None, 1:] * axes[:, 2] + centre
    return closed_lattice(rings)


def shell(outer: np.ndarray, inner: np.ndarray, *, around: bool = False) -> Shape:
    """What is between two surfaces of rows of points, float [M, N, 3] each, with its rims.

    around: the last column meets the first. A first or last row of one point leaves no hole.
    """
    if around:
        return outward(lattice(np.concatenate([outer, inner[::-1]]), around=True, along=True))
    # Every column goes up outside and down inside; the first and the last are ends.
    rings = np.concatenate([outer, inner[::-1]]).swapaxes(0, 1)
    count = len(outer)
    shape = lattice(rings, around=True)
    ends = []
    for column, turn in ((0, -1), (len(rings) - 1, 1)):
        out = column * 2 * count + np.arange(count)
        back = column * 2 * count + 2 * count - 1 - np.arange(count)
        ends += [
            np.stack([out[:-1], out[1:], back[1:]], axis=1)[:, ::turn],
            np.stack([out[:-1], back[1:], back[:-1]], axis=1)[:, ::turn],
        ]
    return outward(Shape(shape.vertices, np.vstack([shape.triangles, *ends])))


def disc(outline: np.ndarray, centre: np.ndarray, rings: int = 4) -> Shape:
    """A sheet that fills an outline, float [N, 3], counter-clockwise as seen, bent towards its centre [3]."""
    share = np.linspace(1, 0, rings + 1)[:-1]
    bend = 1 - (1 - share) ** 2
    flat = outline.mean(axis=0)
    points = [flat + s * (outline - flat) + (1 - s**2) * (centre - flat) for s in bend]
    sheet = lattice(np.stack(points), around=True)
    count = len(outline)
    inner = (rings - 1) * count + np.arange(count)
    fan = np.stack([inner, np.roll(inner, -1), np.full(count, rings * count)], axis=1)
    return Shape(np.vstack([sheet.vertices, centre]), np.vstack([sheet.triangles, fan]))


def _steady_up(path: np.ndarray) -> np.ndarray:
    """A direction at right angles to a path, carried along it without twisting, float64 [N, 3]."""
    tangent = unit(np.gradient(path, axis=0))
    up = np.eye(3)[np.abs(tangent[0]).argmin()]
    found = []
    for along in tangent:
        up = unit(up - (up @ along) * along)
        found.append(up)
    return np.array(found)

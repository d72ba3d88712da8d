# SPDX-License-Identifier: GPL-3.0-or-later
"""Round limbs that flow into one another, as one surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.worn.shapes import Shape, outward

NEGLIGIBLE = 8.0
"""So many times soft outside of a limb it is not felt."""


@dataclass(frozen=True, eq=False)
class Cones:
    """Limbs with round ends. starts, ends: float [N, 3]. first, last: their radii, float [N]."""

    starts: np.ndarray
    ends: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def distance(self, points: np.ndarray, soft: float) -> np.ndarray:
        """About how far points [P, 3] are outside of them together, float64 [P]; below zero inside.

        soft: mm within which limbs that meet flow together.
        """
        total = np.zeros(len(points))
        for number in range(len(self.starts)):
            total += self._closeness(number, points, soft)
        return -soft * np.log(np.maximum(total, 1e-300))

    def on_grid(self, axes: list[np.ndarray], soft: float) -> np.ndarray:
        """The same at the points of a grid, float64 [I, J, K]; far outside it is only large."""
        total = np.zeros([len(axis) for axis in axes])
        for number, (start, end) in enumerate(zip(self.starts, self.ends, strict=True)):
            room = max(self.first[number], self.last[number]) + NEGLIGIBLE * soft
            low, high = np.minimum(start, end) - room, np.maximum(start, end) + room
            part = tuple(
                slice(np.searchsorted(axis, low[k]), np.searchsorted(axis, high[k]))
                for k, axis in enumerate(axes)
            )
            near = np.stack(
                np.meshgrid(*(axis[own] for axis, own in zip(axes, part, strict=True)), indexing="ij"), -1
            )
            total[part] += self._closeness(number, near.reshape(-1, 3), soft).reshape(near.shape[:3])
        return -soft * np.log(np.maximum(total, 1e-300))

    def _closeness(self, number: int, points: np.ndarray, soft: float) -> np.ndarray:
        start, first, last = self.starts[number], self.first[number], self.last[number]
        along = self.ends[number] - start
        share = np.clip((points - start) @ along / max(float(along @ along), 1e-9), 0, 1)
        away = np.linalg.norm(points - start - share[:, None] * along, axis=1)
        return np.exp(-(away - first - share * (last - first)) / soft)


def skin_of(limbs: Cones, soft: float, step: float) -> Shape:
    """The surface of limbs.

    Surface nets (Gibson, "Constrained elastic surface nets", MICCAI 1998): a vertex in each cell of a grid
    through which the surface goes, and a square for each edge of the grid through which it goes; the vertices
    are then moved onto the surface itself. step: of the grid, mm.
    """
    widest = max(limbs.first.max(), limbs.last.max()) + 2 * step
    both = np.concatenate([limbs.starts, limbs.ends])
    low, high = both.min(axis=0) - widest, both.max(axis=0) + widest
    axes = [np.arange(low[k], high[k] + step, step) for k in range(3)]
    values = limbs.on_grid(axes, soft)
    shape = values.shape
    inside = values < 0
    cells = np.stack(
        [
            inside[i : shape[0] - 1 + i, j : shape[1] - 1 + j, k : shape[2] - 1 + k]
            for i in (0, 1) for j in (0, 1) for k in (0, 1)
        ]
    )  # fmt: skip
    mixed = cells.any(axis=0) & ~cells.all(axis=0)
    number = np.full(mixed.shape, -1)
    number[mixed] = np.arange(mixed.sum())
    vertices = np.stack([axes[k][where] for k, where in enumerate(np.nonzero(mixed))], axis=1) + step / 2
    value = limbs.distance(vertices, soft)
    slope = np.stack([(limbs.distance(vertices + 0.05 * axis, soft) - value) / 0.05 for axis in np.eye(3)], 1)
    slope /= np.maximum((slope**2).sum(axis=1, keepdims=True), 0.1)
    for _ in range(2):
        vertices = vertices - np.clip(value[:, None] * slope, -step, step)
        value = limbs.distance(vertices, soft)
    squares = []
    for axis in range(3):
        one, other = [a for a in range(3) if a != axis]
        ahead = np.moveaxis(inside, (axis, one, other), (0, 1, 2))
        cell = np.moveaxis(number, (axis, one, other), (0, 1, 2))
        for outside_first in (True, False):
            crossed = (ahead[:-1] != ahead[1:]) & (ahead[1:] == outside_first)
            i, j, k = np.nonzero(crossed[:, 1:-1, 1:-1])
            corners = [cell[i, j, k], cell[i, j + 1, k], cell[i, j + 1, k + 1], cell[i, j, k + 1]]
            # Axes in the order of a rotation have one sign, the others the other.
            turned = outside_first == (axis != 1)
            squares.append(np.stack(corners[::-1] if turned else corners, axis=1))
    faces = np.concatenate(squares)
    return outward(Shape(vertices, np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])))

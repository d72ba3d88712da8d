# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pixels a head can cover: only these are rendered, the rest is the backdrop's colour."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles

MARGIN = 2
"""Pixels around the projected mesh: a sample lies up to 0.75 px from its pixel's centre."""

EXACT = 8192
"""Meshes with more vertices are bounded by boxes of cells instead."""

CELLS = 16
"""Cells along the longest side of a mesh."""

KEPT = 3
"""Backdrops of a render worker: of the images, and of the looks by which heads are placed."""

_WIDTH, _HEIGHT, _DATA = slice(18, 22), slice(22, 26), slice(10, 14)

Box = tuple[int, int, int, int]
"""First and last + 1 column, then the same for rows, counted from the bottom as Blender does."""


class Outline:
    """Points whose convex hull holds a head; see :meth:`box`.

    vertices: float [V, 3], frame U, mm, pivot at the origin.
    """

    def __init__(self, vertices: np.ndarray) -> None:
        points = vertices if len(vertices) <= EXACT else _cell_corners(vertices)
        # Of one number after another products and extremes are found sooner.
        self._points = (points @ CAMERA_FROM_GRAPHICS).T.copy()

    def box(
        self, ypr_deg: Sequence[float], camera: Camera, offset_mm: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Box | None:
        """The pixels the mesh can touch at a pose, None if there are none.

        offset_mm: where it is moved before it turns, frame U.
        """
        rotation = rotation_from_angles(np.asarray(ypr_deg, dtype=np.float64))
        moved = rotation @ (np.asarray(offset_mm) @ CAMERA_FROM_GRAPHICS) + camera.translation_mm
        points = rotation @ self._points + moved[:, None]
        size = (camera.width, camera.height)
        if points[2].min() < 0.05 * camera.distance_mm:
            return 0, size[0], 0, size[1]  # part of it is beside the camera: there is no outline
        pixels = camera.project(points.T).T
        low = np.clip(np.floor(pixels.min(axis=1)) - MARGIN, 0, size).astype(int).tolist()
        high = np.clip(np.ceil(pixels.max(axis=1)) + MARGIN, 0, size).astype(int).tolist()
        if low[0] >= high[0] or low[1] >= high[1]:
            return None
        return low[0], high[0], size[1] - high[1], size[1] - low[1]


def around(boxes: Iterable[Box | None]) -> Box | None:
    """The box that holds some boxes."""
    there = [box for box in boxes if box is not None]
    if not there:
        return None
    left, right, bottom, top = zip(*there, strict=True)
    return min(left), max(right), min(bottom), max(top)


class Backdrop:
    """A frame without the head, onto which what was rendered of the head is laid."""

    def __init__(self, path: Path) -> None:
        self._empty = path.read_bytes()
        self._size = _size(self._empty)

    def lay(self, path: Path, box: Box | None) -> None:
        """Replace the cropped frame at path by the whole one; without a box there was none.

        Raises RuntimeError if the frame there is not as large as the box.
        """
        whole = bytearray(self._empty)
        if box is not None:
            cropped = path.read_bytes()
            left, right, bottom, top = box
            if _size(cropped) != (right - left, top - bottom):
                raise RuntimeError(f"{path}: Blender rendered {_size(cropped)} pixels of {box}")
            _pixels(whole)[bottom:top, left:right] = _pixels(cropped)
        path.write_bytes(whole)


class Backdrops:
    """Backdrops by all that they depend on, which is no head: the newest few serve the heads to come."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, Backdrop] = {}

    def find(self, depends_on: Hashable) -> Backdrop | None:
        """The one that was kept, which is the newest now."""
        found = self._kept.pop(depends_on, None)
        if found is not None:
            self._kept[depends_on] = found
        return found

    def keep(self, depends_on: Hashable, backdrop: Backdrop) -> None:
        """Keep one, and drop the oldest of too many."""
        self._kept[depends_on] = backdrop
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]


def _size(bmp: bytes | bytearray) -> tuple[int, int]:
    return int.from_bytes(bmp[_WIDTH], "little"), int.from_bytes(bmp[_HEIGHT], "little")


def _pixels(bmp: bytes | bytearray) -> np.ndarray:
    """View of a 24-bit BMP's pixels, uint8 [H, W, 3], from the bottom; rows fill up to 4 bytes."""
    width, height = _size(bmp)
    start = int.from_bytes(bmp[_DATA], "little")
    stride = -(-3 * width // 4) * 4
    rows = np.frombuffer(bmp, np.uint8, stride * height, start).reshape(height, stride)
    return rows[:, : 3 * width].reshape(height, width, 3)


def _cell_corners(vertices: np.ndarray) -> np.ndarray:
    """Corners of the vertices' own box in each cell of a grid: their hull holds the mesh."""
    low = vertices.min(axis=0)
    cell = max(float(np.ptp(vertices, axis=0).max()), 1e-9) / CELLS
    place = np.minimum((vertices - low) // cell, CELLS - 1).astype(np.int64) @ (CELLS**2, CELLS, 1)
    _, owner = np.unique(place, return_inverse=True)
    lows = np.full((owner.max() + 1, 3), np.inf)
    highs = -lows
    np.minimum.at(lows, owner, vertices)
    np.maximum.at(highs, owner, vertices)
    both = np.stack([lows, highs])
    choice = np.indices((2, 2, 2)).reshape(3, -1).T
    return np.concatenate([both[pick, :, range(3)].T for pick in choice])

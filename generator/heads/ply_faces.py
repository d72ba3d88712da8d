# SPDX-License-Identifier: GPL-3.0-or-later
"""What trimesh does not make of a PLY: triangle strips, and faces that have a colour each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from generator.heads.triangles import of_polygons, of_strips

_STRIPS = "tristrips"
_UV = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))
_LISTS = ("vertex_indices", "vertex_index")


def strip_triangles(elements: dict[str, Any]) -> np.ndarray | None:
    """int64 [T, 3] of the element ``tristrips``; None without one. A negative index ends a strip."""
    lists = _lists(elements.get(_STRIPS))
    if lists is None:
        return None
    ended = [np.append(np.asarray(strip, dtype=np.int64), -1) for strip in lists]
    return of_strips(np.concatenate(ended)) if ended else None


def polygon_triangles(elements: dict[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """int64 [T, 3] of the faces, cut into fans, and int64 [T] which face; None without faces."""
    lists = _lists(elements.get("face"))
    if lists is None or not len(lists) or min(map(len, lists)) < 3:
        return None
    corners, face = of_polygons(np.array([len(polygon) for polygon in lists], dtype=np.int64))
    return np.concatenate([np.asarray(polygon, dtype=np.int64) for polygon in lists])[corners], face


def vertex_uv(elements: dict[str, Any]) -> np.ndarray | None:
    """float [V, 2] of coordinates that vertices have; None without."""
    data = elements["vertex"]["data"]
    known = elements["vertex"]["properties"]
    for pair in _UV:
        if all(name in known for name in pair):
            return np.column_stack([data[name] for name in pair])
    return None


def paint(colors: np.ndarray, path: Path) -> np.ndarray:
    """Write an image with a pixel for each colour that occurs; float32 [F, 2], where in it each lies, v up.

    colors: uint8 [F, 3].
    """
    distinct, which = np.unique(colors, axis=0, return_inverse=True)
    side = int(np.ceil(np.sqrt(len(distinct))))
    pixels = np.zeros((side * side, 3), np.uint8)
    pixels[: len(distinct)] = distinct
    Image.fromarray(pixels.reshape(side, side, 3)).save(path)
    row, column = np.divmod(which.reshape(-1), side)
    # The middle of a pixel, where no neighbour is mixed in.
    return np.stack([(column + 0.5) / side, 1 - (row + 0.5) / side], axis=1).astype(np.float32)


def _lists(element: dict[str, Any] | None) -> Any:
    """The vertex lists of an element as trimesh has read it; None without."""
    if element is None or not element["length"]:
        return None
    data: Any = element.get("data")
    if isinstance(data, dict):
        return next((data[name] for name in _LISTS if name in data), None)
    names = () if data is None else data.dtype.names or ()
    return next((data[name]["f1"] for name in _LISTS if name in names), None)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture coordinates beyond the image: how a texture goes on there, and coordinates brought back into it."""

from __future__ import annotations

import numpy as np

from generator.errors import HeadError

EXTEND, REPEAT, MIRROR = "extend", "repeat", "mirror"
"""The border's colour, the image again, the image again and every second time flipped."""

ROUNDING = 1e-3
"""Coordinates as little beyond the image as this are an exporter's rounding, and lie at its border."""


def bring_back(uv: np.ndarray, wraps: tuple[str, str]) -> tuple[np.ndarray, str]:
    """The same picture with coordinates in the image, wherever a triangle lies in one tile.

    So a texture that is used in another tile is drawn as it is in the first, without the other side
    shining through at its border; only for triangles across several tiles it must really go on.

    Parameters
    ----------
    uv: float [T, 3, 2]. wraps: how the texture goes on along u and along v.

    Returns
    -------
    uv: float64 [T, 3, 2], what was given where all of it lies in the image. wrap: how the texture goes on
    for what still lies beyond it, EXTEND if nothing does. Of two ways along u and v that are both needed it
    is that along u; see :func:`needs_both`.

    Raises
    ------
    HeadError: a coordinate is not finite.
    """
    if not np.isfinite(uv).all():
        raise HeadError("a texture coordinate is not a finite number; export the mesh again")
    uv = np.asarray(uv, dtype=np.float64)
    if uv.min(initial=0) >= -ROUNDING and uv.max(initial=0) <= 1 + ROUNDING:
        return uv, EXTEND
    uv = uv.copy()
    needed = [_bring_back(uv[..., axis], wrap) for axis, wrap in enumerate(wraps)]
    return uv, next((wrap for wrap, need in zip(wraps, needed, strict=True) if need), EXTEND)


def needs_both(uv: np.ndarray, wraps: tuple[str, str]) -> bool:
    """Do coordinates that were brought back leave the image along both axes, and it goes on differently?"""
    beyond = (uv < -ROUNDING) | (uv > 1 + ROUNDING)
    return wraps[0] != wraps[1] and bool(beyond[..., 0].any() and beyond[..., 1].any())


def _bring_back(values: np.ndarray, wrap: str) -> bool:
    """Move the coordinates of triangles in one tile, float [T, 3], in place; do others leave the image?"""
    low, high = values.min(axis=1), values.max(axis=1)
    beyond = (low < -ROUNDING) | (high > 1 + ROUNDING)
    if wrap == EXTEND:
        return bool(beyond.any())
    tile = np.floor(low + ROUNDING)
    one_tile = beyond & (high <= tile + 1 + ROUNDING)
    moved = values[one_tile] - tile[one_tile, None]
    if wrap == MIRROR:
        odd = tile[one_tile] % 2 == 1
        moved[odd] = 1 - moved[odd]
    values[one_tile] = moved
    return bool((beyond & ~one_tile).any())


def texels(uv: np.ndarray, wrap: str, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) of the pixels that texture coordinates fall on.

    uv: float [..., 2], v up. shape: height and width of the image.
    """
    if wrap == REPEAT:
        uv = uv % 1.0
    elif wrap == MIRROR:
        uv = 1.0 - np.abs(uv % 2.0 - 1.0)
    height, width = shape
    columns = np.clip(uv[..., 0] * width, 0, width - 1).astype(int)
    rows = np.clip((1.0 - uv[..., 1]) * height, 0, height - 1).astype(int)
    return rows, columns

# SPDX-License-Identifier: GPL-3.0-or-later
"""Long hair: a sheet that leaves the scalp above the ears and hangs around the neck."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from generator.heads.parametric.appearance import Appearance, hair_tone
from generator.heads.parametric.noise import smooth_noise, smoothstep
from generator.heads.parametric.template import PARTS, head_template

CURTAIN_SIZE = 256
"""Texels along each side of hair.png."""

_COLUMNS, _ROWS = 49, 15
_TOP = 8.12


def curtain_vertices(neutral: np.ndarray, look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """Vertices [C, 3] dm of the sheet around a neutral head's vertices [V, 3] dm."""
    across = np.linspace(-1, 1, _COLUMNS)[None, :]
    down = np.linspace(0, 1, _ROWS)[:, None]
    angle = np.deg2rad(180 + across * (180 - look.curtain_angle))
    y = _TOP + (look.curtain_end - _TOP) * down + 0.0 * across
    y = y + 0.05 * down * smooth_noise(rng, (angle[0] * 6, 0 * angle[0]))[None, :]
    # Above the ears the sheet lies below the lifted scalp, lower down it clears them.
    skull = np.sqrt(np.clip(1 - ((y - 7.62) / 0.87) ** 2, 0.05, 1))
    hang = smoothstep(8.02, 7.38, y)
    outside = 0.86 if look.curtain_angle > 100 else 0.95
    waves = 1 + 0.03 * hang * smooth_noise(rng, (angle * 9 + 0 * y, y * 1.5))
    half_width = (0.73 * skull + (outside - 0.73 * skull) * hang) * waves
    depth = (0.77 * skull + (0.88 - 0.77 * skull) * hang) * waves
    # Tips turn in towards the neck.
    tuck = 1 - 0.12 * smoothstep(0.75, 1.0, down) - 0.06 * smoothstep(6.9, 6.2, y)
    points = np.stack(
        [half_width * tuck * np.sin(angle), y, 0.42 + depth * tuck * np.cos(angle)], axis=-1
    ).reshape(-1, 3)
    # Shapes move the sheet as they move the skull and ears next to it.
    template = head_template()
    anchors = _anchors()
    distance, nearest = cKDTree(template.canonical[anchors]).query(points, k=32)
    weights = 1 / (distance + 0.05) ** 2
    weights /= weights.sum(1, keepdims=True)
    moved = (neutral - template.canonical)[anchors]
    return points + np.einsum("ck,ckd->cd", weights, moved[nearest])


@lru_cache(maxsize=1)
def curtain_topology() -> tuple[np.ndarray, np.ndarray]:
    """Triangles int32 [T, 3] and texture coordinates [C, 2] (one a vertex), v up."""
    grid = np.arange(_ROWS * _COLUMNS).reshape(_ROWS, _COLUMNS)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    triangles = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    u, v = np.meshgrid(np.linspace(0.01, 0.99, _COLUMNS), np.linspace(0.99, 0.01, _ROWS))
    return triangles.astype(np.int32), np.stack([u, v], axis=-1).reshape(-1, 2)


def paint_curtain(look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """Strands that hang down, sRGB uint8 [CURTAIN_SIZE, CURTAIN_SIZE, 3]."""
    v, u = np.meshgrid(*[(np.arange(CURTAIN_SIZE) + 0.5) / CURTAIN_SIZE] * 2, indexing="ij")
    sway = u + 0.006 * np.sin(9 * v + rng.uniform(0, 6))
    strands = 0.6 * smooth_noise(rng, (sway * 120, v * 2.5)) + 0.4 * smooth_noise(rng, (sway * 40, v * 1.5))
    shade = (1 + 0.42 * strands) * (0.80 + 0.18 * v)
    return (np.clip(hair_tone(look) * shade[..., None], 0, 1) * 255 + 0.5).astype(np.uint8)


@lru_cache(maxsize=1)
def _anchors() -> np.ndarray:
    """Vertices of the skull, ears and nape, away from the face and jaw."""
    template = head_template()
    x, y, z = template.canonical.T
    skin = np.isin(np.arange(len(x)), template.triangles[template.part == PARTS.index("skin")])
    return np.flatnonzero(skin & ((y > 7.7) | (z < 0.75)) & (z < 1.1))

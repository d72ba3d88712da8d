# SPDX-License-Identifier: GPL-3.0-or-later
"""Beards and brows in the atlas."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from generator.heads.parametric.appearance import Appearance, hair_tone
from generator.heads.parametric.atlas import ATLASES, Atlas
from generator.heads.parametric.layers import lay
from generator.heads.parametric.noise import NoiseField, grain, smoothstep

HALF = 0.5
"""From so much cover on, a texel is hair and not skin."""

_BROW_T = np.array([0.0, 0.12, 0.35, 0.62, 0.82, 1.0])
_BROW_Y = np.array([7.452, 7.462, 7.480, 7.494, 7.484, 7.448])
_BROW_HALF = np.array([0.020, 0.038, 0.038, 0.030, 0.019, 0.006])
_BROW_LEAN = np.deg2rad([80, 62, 35, 12, -12, -30])
_BROW_INNER, _BROW_LENGTH = 0.105, 0.43


def beard_cover(points: np.ndarray, beard: str) -> np.ndarray:
    """Where a beard grows, 0-1 [...], for canonical points [..., 3]."""
    x, y, z = np.moveaxis(points, -1, 0)
    side = np.abs(x)
    angle = np.degrees(np.arctan2(side, z - 0.35))
    top = np.interp(angle, [0, 12, 22, 38, 52, 62, 70], [6.79, 6.79, 6.74, 6.72, 6.88, 7.10, 7.25])
    cover = smoothstep(0.03, -0.07, y - top) * smoothstep(72, 64, angle) * smoothstep(6.06, 6.24, y)
    cover = cover * smoothstep(0.45, 0.75, z)
    moustache = smoothstep(6.665, 6.70, y) * smoothstep(0.34, 0.26, side)
    if beard == "moustache":
        return cover * moustache
    if beard == "goatee":
        chin = smoothstep(0.30, 0.23, side) * smoothstep(6.8, 6.5, y) * smoothstep(1.0, 1.3, z)
        return cover * np.maximum(moustache, chin)
    return cover


class _Beard(NamedTuple):
    where: np.ndarray
    cover: np.ndarray
    hairs: NoiseField


class _Brows(NamedTuple):
    where: np.ndarray
    height: np.ndarray  # above the middle line, dm
    half: np.ndarray  # width to either side, dm
    ends: np.ndarray
    hairs: NoiseField


@lru_cache(maxsize=4 * ATLASES)
def _beard(atlas: Atlas, beard: str) -> _Beard:
    near = np.flatnonzero(atlas.is_part("skin") & (atlas.points[..., 1] < 7.3) & (atlas.points[..., 2] > 0.4))
    cover = beard_cover(atlas.texels(near), beard) * (1 - smoothstep(0.1, 0.5, atlas.lips.ravel()[near]))
    near, cover = near[cover > 0], cover[cover > 0].astype(np.float32)
    x, y, z = atlas.texels(near).T
    return _Beard(near, cover, NoiseField(np.arctan2(x, z - 0.35) * 70, y * 24))


def beard_texels(atlas: Atlas, look: Appearance) -> np.ndarray:
    """Texels where :func:`paint_beard` covers the skin, int [K]; none of stubble."""
    if look.beard in ("none", "stubble"):
        return np.empty(0, dtype=np.int64)
    place = _beard(atlas, look.beard if look.beard in ("moustache", "goatee") else "full")
    return place.where[place.cover > HALF]


def brow_texels(atlas: Atlas, look: Appearance) -> np.ndarray:
    """Texels where :func:`paint_brows` covers the skin, int [K]."""
    place = _brows(atlas)
    across = (place.height - np.float32(look.brow_height)) / (place.half * np.float32(look.brow_width))
    return place.where[smoothstep(1.25, 0.45, np.abs(across)) * place.ends > HALF]


def paint_beard(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Paint the beard into color float32 [3, N], in place."""
    if look.beard == "none":
        return
    place = _beard(atlas, look.beard if look.beard in ("moustache", "goatee") else "full")
    hairs = place.hairs.draw(rng)
    coarse = grain(rng, len(hairs))
    if look.beard == "stubble":
        alpha = place.cover * (0.12 + 0.28 * look.beard_density) * (1 + 0.35 * hairs + 0.15 * coarse)
    else:
        alpha = smoothstep(0.12, 0.75, place.cover + 0.28 * hairs) * (0.62 + 0.33 * look.beard_density)
        alpha *= smoothstep(0.0, 0.08, place.cover)
    tone = (hair_tone(look) * 1.05).astype(np.float32)
    lay(color, place.where, tone[:, None] * (1 + 0.4 * hairs + 0.08 * coarse), np.clip(alpha, 0, 1))


@lru_cache(maxsize=ATLASES)
def _brows(atlas: Atlas) -> _Brows:
    near = np.flatnonzero(
        atlas.is_part("skin")
        & (np.abs(atlas.points[..., 1] - 7.46) < 0.16)
        & (atlas.points[..., 2] > 0.9)
        & (np.abs(atlas.points[..., 0]) < 0.65)
    )
    x, y, _ = atlas.texels(near).T
    side = np.abs(x)
    place = (side - _BROW_INNER) / _BROW_LENGTH
    t = np.clip(place, 0, 1)
    lean = np.interp(t, _BROW_T, _BROW_LEAN)
    # Hairs lean from upright at the nose to flat at the temple; both brows differ.
    along = side * np.cos(lean) + y * np.sin(lean) + 2.0 * (x > 0)
    beside = -side * np.sin(lean) + y * np.cos(lean)
    return _Brows(
        near,
        (y - np.interp(t, _BROW_T, _BROW_Y)).astype(np.float32),
        np.interp(t, _BROW_T, _BROW_HALF).astype(np.float32),
        smoothstep(-0.05, 0.08, place) * smoothstep(1.06, 0.85, place),
        NoiseField(along * 14, beside * 120),
    )


def paint_brows(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Paint both brows into color float32 [3, N], in place."""
    place = _brows(atlas)
    across = (place.height - np.float32(look.brow_height)) / (place.half * np.float32(look.brow_width))
    hairs = place.hairs.draw(rng)
    cover = smoothstep(1.25, 0.45, np.abs(across) + 0.45 * hairs) * place.ends
    tone = hair_tone(look) * 0.85
    tone *= min(1.0, 0.45 / tone.max())
    lay(color, place.where, tone, np.clip(look.brow_density * cover * (0.80 + 0.2 * hairs), 0, 1))

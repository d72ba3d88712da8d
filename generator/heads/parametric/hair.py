# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair on the scalp: where it grows, how far it lifts the surface, how it is painted."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from generator.heads.parametric.appearance import Appearance, hair_tone
from generator.heads.parametric.atlas import ATLASES, Atlas, head_atlas
from generator.heads.parametric.layers import lay
from generator.heads.parametric.noise import NoiseField, grain, smooth_noise, smoothstep
from generator.heads.parametric.template import PARTS, head_template
from generator.heads.triangles import vertex_normals

# The usual hairline on the base mesh: height (dm) against the angle from the face, degrees.
_ANGLES = np.array([0, 14, 28, 42, 54, 62, 67, 72, 78, 95, 104, 120, 180.0])
_HEIGHTS = np.array([8.02, 8.01, 7.98, 7.86, 7.70, 7.45, 7.18, 7.22, 7.46, 7.42, 7.02, 6.82, 6.68])
_RECESSION = np.array([0.15, 0.5, 1.0, 0.9, 0.5, 0.2, 0, 0, 0, 0, 0, 0, 0])
_FRONT = np.array([1, 1, 0.9, 0.6, 0.3, 0.1, 0, 0, 0, 0, 0, 0, 0])
_AXIS_Z = 0.35

LOWEST = 0.35
"""How far below the usual line (dm) hair is painted at most, by hairline and fringe of an Appearance."""
_MARGIN = -0.15  # Height above the line below which no hair grows, whatever the strands.
_STEP = 0.05
_STEPS = np.arange(0, 180 + _STEP, _STEP)


def hair_height(points: np.ndarray, look: Appearance) -> np.ndarray:
    """Height above the hairline in dm, [...] for canonical points [..., 3]; negative on bare skin."""
    angle = np.degrees(np.arctan2(np.abs(points[..., 0]), points[..., 2] - _AXIS_Z))
    height = points[..., 1] - np.interp(angle, _ANGLES, _hairline(look))
    if look.hair_style == "bald":
        # What is left is a wreath around the back of the head.
        return np.minimum(height, 7.62 - points[..., 1] - 0.5 * np.maximum(points[..., 2] - 0.2, 0))
    return height


def _hairline(look: Appearance) -> np.ndarray:
    """Its height at _ANGLES, dm."""
    return _HEIGHTS + (look.hairline - look.fringe) * _FRONT + look.recession * _RECESSION


def hair_volume(vertices: np.ndarray, look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """Offsets [V, 3], dm, that lift the scalp of a neutral head by its hair."""
    template = head_template()
    skin = template.triangles[template.part == PARTS.index("skin")]
    normals, _ = vertex_normals(vertices, skin)
    lift = hair_lift(template.canonical, _ear_distance(), look, rng)
    lift[~np.isin(np.arange(len(lift)), skin)] = 0
    return normals * lift[:, None]


def hair_lift(
    points: np.ndarray, ear_distance: np.ndarray, look: Appearance, rng: np.random.Generator
) -> np.ndarray:
    """How far hair stands off the scalp, dm, [V], at canonical points [V, 3] so far from the ears, dm [V]."""
    height = hair_height(points, look)
    rise = smoothstep(-0.02, 0.38, height) * smoothstep(0.03, 0.22, ear_distance)
    top = 0.55 + 0.45 * smoothstep(7.6, 8.3, points[:, 1])
    lumps = 1 + 0.22 * smooth_noise(rng, tuple(points.T * 3.0 + rng.uniform(0, 8)))
    return look.volume_mm / 100 * rise * top * lumps


@lru_cache(maxsize=1)
def _ear_distance() -> np.ndarray:
    """Distance of every vertex to the ears on the base mesh, dm, [V]."""
    atlas = head_atlas()
    ears = atlas.points[atlas.ears > 0.5][::7]
    return cKDTree(ears).query(head_template().canonical)[0]


class _Scalp(NamedTuple):
    """Where hair may grow whatever the hairline, and what is known there."""

    where: np.ndarray
    angle: np.ndarray  # from the face, in _STEPS
    y: np.ndarray
    behind: np.ndarray  # below the top of the wreath of a bald head, dm
    crown: np.ndarray
    keep: np.ndarray
    fine: NoiseField
    coarse: NoiseField


@lru_cache(maxsize=ATLASES)
def _scalp(atlas: Atlas) -> _Scalp:
    where = np.flatnonzero(atlas.is_part("skin") & (atlas.ears < 0.5))
    x, y, z = atlas.texels(where).T
    angle = np.degrees(np.arctan2(np.abs(x), z - _AXIS_Z))
    lowest = np.interp(angle, _ANGLES, _HEIGHTS - LOWEST * _FRONT)
    grows = y - lowest > _MARGIN
    where, angle, x, y, z = where[grows], angle[grows], x[grows], y[grows], z[grows]
    # Strands run from the crown down the head, in waves.
    around = np.arctan2(x, z - 0.15)
    along = np.arctan2(np.hypot(x, z - 0.15), y - 7.3)
    around = around + 0.05 * np.sin(6 * along + 2)
    return _Scalp(
        where=where,
        angle=np.round(angle / _STEP).astype(np.int32),
        y=y.copy(),
        behind=7.62 - y - 0.5 * np.maximum(z - 0.2, 0),
        # Highlights on the crown, darkness at the roots.
        crown=0.8 + 0.35 * smoothstep(7.6, 8.3, y),
        keep=1 - 0.9 * atlas.ears.ravel()[where],
        fine=NoiseField(around * 38, along * 2.5),
        coarse=NoiseField(around * 12, along * 1.5),
    )


def hair_texels(atlas: Atlas, look: Appearance) -> np.ndarray:
    """Texels where :func:`paint_hair` covers the skin, int [K]; none of a bald head's wreath."""
    scalp = _scalp(atlas)
    if look.hair_style == "bald":
        return np.empty(0, dtype=np.int64)
    line = np.interp(_STEPS, _ANGLES, _hairline(look)).astype(np.float32)
    return scalp.where[(scalp.y > line[scalp.angle]) & (scalp.keep > 0.5)]


def paint_hair(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Paint scalp hair into color float32 [3, N], in place."""
    scalp = _scalp(atlas)
    line = np.interp(_STEPS, _ANGLES, _hairline(look)).astype(np.float32)
    height = scalp.y - line[scalp.angle]
    if look.hair_style == "bald":
        height = np.minimum(height, scalp.behind)
    strands = 0.6 * scalp.fine.draw(rng) + 0.4 * scalp.coarse.draw(rng)
    near = np.flatnonzero(height > _MARGIN)
    height, strands = height[near], strands[near]
    fuzz = grain(rng, len(near))
    soft = 0.025 if look.hair_style in ("bald", "shaved") else 0.015
    cover = smoothstep(-0.06, 0.05 + soft, height + 0.05 * strands + soft * fuzz)
    cover *= scalp.keep[near] * np.float32({"bald": 0.35, "shaved": 0.72}.get(look.hair_style, 1.0))
    shade = (1 + 0.42 * strands + 0.06 * fuzz) * scalp.crown[near]
    shine = 0.02 * np.maximum(strands, 0)
    lay(color, scalp.where[near], hair_tone(look).astype(np.float32)[:, None] * shade + shine, cover)

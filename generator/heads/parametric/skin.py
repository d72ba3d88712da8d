# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a head: skin, lips, lines and lids in the atlas, and the order of all its layers.

What is the same for every head in an atlas is worked out once, in the functions that are cached.

Positions are decimetres on the base mesh: eyes at (±0.31, 7.28), nose tip at
(0, 6.91), lips meeting at 6.61, chin at 6.2, hairline about 8.0.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from PIL import Image

from generator.heads.parametric.appearance import Appearance, skin_tone
from generator.heads.parametric.atlas import ATLASES, Atlas
from generator.heads.parametric.facial_hair import paint_beard, paint_brows
from generator.heads.parametric.hair import paint_hair
from generator.heads.parametric.layers import darken, lay, mix, put
from generator.heads.parametric.mouth import paint_mouth
from generator.heads.parametric.noise import NoiseField, grain, smoothstep

_GRAIN = 0.012


def paint_skin(atlas: Atlas, look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """skin.png as sRGB uint8 [ATLAS_SIZE, ATLAS_SIZE, 3]. atlas: of any mesh of a head."""
    tone = skin_tone(look.melanin).astype(np.float32)
    color = _complexion(atlas, look, tone, rng)
    _spots(color, atlas, look, rng)
    _age(color, atlas, look, rng)
    _lips(color, atlas, look, tone, rng)
    color *= _shade(atlas)
    paint_beard(color, atlas, look, rng)
    paint_brows(color, atlas, look, rng)
    paint_hair(color, atlas, look, rng)
    _eyes(color, atlas, look)
    paint_mouth(color, atlas, look, tone)
    color *= 255 + 255 * _GRAIN * grain(rng, color.shape[1])
    color += 0.5
    np.clip(color, 0, 255.5, out=color)
    return np.stack([*color.astype(np.uint8)], axis=-1).reshape(*atlas.part.shape, 3)


class _Ground(NamedTuple):
    """What a complexion is made of, on every fourth texel of every fourth row, [N / 16]."""

    broad: NoiseField
    narrow: NoiseField
    blood: np.ndarray
    hollow: np.ndarray
    below: np.ndarray


@lru_cache(maxsize=ATLASES)
def _ground(atlas: Atlas) -> _Ground:
    points = atlas.points[::4, ::4].reshape(-1, 3)
    x, y, z = points.T
    side = np.abs(x)

    def around(cx: float, cy: float, cz: float, size: float) -> np.ndarray:
        return np.exp(-((side - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2) / (2 * size**2))

    blood = 0.8 * around(0.40, 6.95, 1.28, 0.17) + 0.7 * around(0.0, 6.92, 1.66, 0.09)
    blood += 0.45 * around(0.10, 6.88, 1.55, 0.08) + 0.4 * around(0.0, 6.30, 1.48, 0.14)
    blood += 0.6 * atlas.ears[::4, ::4].ravel() + 0.25 * around(0.31, 7.36, 1.38, 0.10)
    return _Ground(
        broad=NoiseField(*(points * 6.0).T),
        narrow=NoiseField(*(points * 17.0).T),
        blood=blood,
        hollow=around(0.27, 7.17, 1.37, 0.085),
        below=0.07 * smoothstep(6.35, 6.05, y),
    )


def _complexion(atlas: Atlas, look: Appearance, tone: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Base tone, blotches and blood: float32 [3, N]."""
    ground = _ground(atlas)
    blotch = 0.6 * ground.broad.draw(rng) + 0.4 * ground.narrow.draw(rng)
    blood = ground.blood * look.redness + 0.35 * look.mottle * blotch
    # Darker, bluish hollows below the eyes; a slightly darker jaw and neck.
    hollow = (0.5 + 0.5 * look.ageing) * ground.hollow
    plain = 1 + 0.030 * look.mottle * blotch - ground.below
    height, width = atlas.part.shape
    color = np.empty((3, height * width), dtype=np.float32)
    for k, (warm, blue) in enumerate(zip((0.03, -0.055, -0.05), (0.075, 0.085, 0.055), strict=True)):
        small = tone[k] * (plain + warm * (1.15 - look.melanin) * blood - blue * hollow)
        plane = Image.fromarray(small.astype(np.float32).reshape(len(range(0, height, 4)), -1), mode="F")
        color[k] = np.asarray(plane.resize((width, height), Image.Resampling.BILINEAR)).ravel()
    return color


@lru_cache(maxsize=ATLASES)
def _bare_front(atlas: Atlas) -> np.ndarray:
    bare = atlas.is_part("skin") & (atlas.lips < 0.1) & (atlas.lid > 0.05)
    return np.argwhere(bare & (atlas.points[..., 2] > 0.9))


def _spots(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Freckles and moles, as small discs about points of the skin."""
    front = _bare_front(atlas)
    picture = color.reshape(3, *atlas.part.shape)
    freckles = int(look.freckles * 260)
    for k in range(freckles + look.moles):
        row, column = front[rng.integers(len(front))]
        point = atlas.points[row, column]
        mole = k >= freckles
        if not mole and rng.random() > np.exp(-((abs(point[0]) - 0.25) ** 2 + (point[1] - 7.02) ** 2) / 0.09):
            continue
        size = rng.uniform(0.009, 0.016) if mole else rng.uniform(0.004, 0.009)
        depth = rng.uniform(0.35, 0.6) if mole else look.freckles * rng.uniform(0.08, 0.24)
        window = np.s_[max(row - 12, 0) : row + 13, max(column - 12, 0) : column + 13]
        distance = np.linalg.norm(atlas.points[window] - point, axis=-1)
        mark = depth * smoothstep(size, 0.5 * size, distance)
        for plane, share in zip(picture, (0.6, 0.85, 1.0), strict=True):
            plane[window] *= 1 - share * mark


class _Lines(NamedTuple):
    """Where the lines of age run."""

    where: np.ndarray
    warp: NoiseField
    wave: np.ndarray  # of the forehead, radians before it is warped
    turn: np.ndarray  # about the corner of the eye, radians
    forehead: np.ndarray
    crow: np.ndarray
    fold: np.ndarray


_FOREHEAD_STEP = 0.115
"""From one line to the next, dm."""


@lru_cache(maxsize=ATLASES)
def _lines(atlas: Atlas) -> _Lines:
    height, front = atlas.points[..., 1], atlas.points[..., 2]
    face = np.flatnonzero(atlas.is_part("skin") & (front > 0.75) & (height > 6.45) & (height < 8.0))
    x, y, _ = atlas.texels(face).T
    side = np.abs(x)
    forehead = smoothstep(7.56, 7.66, y) * smoothstep(7.98, 7.86, y) * smoothstep(0.5, 0.3, side)
    outwards, up = side - 0.45, y - 7.27
    turn = np.arctan2(up, outwards + 0.03)
    crow = smoothstep(1.1, 0.7, np.abs(turn)) * smoothstep(0.0, 0.04, outwards)
    crow *= smoothstep(0.17, 0.06, outwards)
    fold_x = np.interp(y, [6.50, 6.62, 6.75, 6.90], [0.335, 0.325, 0.265, 0.185])
    fold = np.exp(-(((side - fold_x) / 0.016) ** 2)) * smoothstep(6.46, 6.60, y) * smoothstep(6.93, 6.84, y)
    lined = (forehead > 0) | (crow > 0) | (fold > 1e-3)
    x, y = x[lined], y[lined]
    return _Lines(
        where=face[lined],
        warp=NoiseField(x * 4 + 9, y * 4),
        wave=(y + 0.05 * x**2) * np.float32(2 * np.pi / _FOREHEAD_STEP),
        turn=turn[lined],
        forehead=0.11 * forehead[lined],
        crow=0.08 * crow[lined],
        fold=(0.15 * fold[lined]).astype(np.float32),
    )


def _age(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Lines on the forehead, beside the eyes and beside the mouth."""
    if look.ageing < 0.12:
        return
    lines = _lines(atlas)
    warp = 0.03 * lines.warp.draw(rng)
    depth = lines.forehead * smoothstep(0.72, 1.0, np.cos(lines.wave + warp * (2 * np.pi / _FOREHEAD_STEP)))
    depth += lines.crow * smoothstep(0.7, 1.0, np.cos(lines.turn * 5 + warp * 40))
    depth += lines.fold
    darken(color, lines.where, look.ageing * depth, (0.75, 1.0, 1.0))


@lru_cache(maxsize=ATLASES)
def _mouth_line(atlas: Atlas) -> tuple[np.ndarray, NoiseField]:
    """Texels of the lips, and their creases."""
    where = np.flatnonzero(atlas.lips > 0.01)
    x, y, _ = atlas.texels(where).T
    return where, NoiseField(x * 70, y * 6)


def _lips(
    color: np.ndarray, atlas: Atlas, look: Appearance, tone: np.ndarray, rng: np.random.Generator
) -> None:
    where, creases = _mouth_line(atlas)
    light = float(tone @ [0.3, 0.59, 0.11])
    tint = np.array([0.85, 0.62, 0.64]) + look.melanin * np.array([-0.05, 0.10, 0.18])
    natural = tone * tint + look.lip_red * light * np.array([0.03, -0.04, -0.02])
    paint = np.array([rng.uniform(0.45, 0.75), rng.uniform(0.10, 0.28), rng.uniform(0.16, 0.32)])
    lip = (natural + (paint - natural) * look.lip_makeup).astype(np.float32)
    strength = atlas.lips.ravel()[where] * np.float32(max(look.lip_color, look.lip_makeup))
    lay(color, where, lip[:, None] * (1 + 0.05 * creases.draw(rng)), strength)


@lru_cache(maxsize=ATLASES)
def _shade(atlas: Atlas) -> np.ndarray:
    """Between the lips, ambient occlusion, red where light comes through skin: factors float32 [3, N]."""
    skin = atlas.is_part("skin")
    seam = 1 - 0.45 * smoothstep(0.035, 0.004, atlas.lip_seam) * skin
    shadow = np.minimum(atlas.occlusion * (1 - 0.75 * atlas.lips), 0.75) * skin
    nostril = np.linalg.norm(np.abs(atlas.points) - np.array([0.09, 6.865, 1.55], dtype=np.float32), axis=-1)
    dark = 1 - 0.55 * smoothstep(0.06, 0.025, nostril) * skin * smoothstep(0.15, 0.4, atlas.occlusion)
    planes = [seam * dark * (1 - share * shadow) for share in (0.85, 1.05, 1.10)]
    return np.stack(planes).reshape(3, -1).astype(np.float32)


class _Lids(NamedTuple):
    lashes: np.ndarray
    line: np.ndarray
    socket: np.ndarray
    depth: np.ndarray


@lru_cache(maxsize=ATLASES)
def _lids(atlas: Atlas) -> _Lids:
    line = smoothstep(0.034, 0.006, atlas.lid) * atlas.is_part("skin")
    line *= 0.30 + 0.60 * smoothstep(7.255, 7.31, atlas.points[..., 1])
    lashes = np.flatnonzero(line > 0)
    socket = np.flatnonzero(atlas.is_part("socket_left", "socket_right"))
    return _Lids(lashes, line.ravel()[lashes], socket, smoothstep(0.0, 0.10, atlas.lid.ravel()[socket]))


def _eyes(color: np.ndarray, atlas: Atlas, look: Appearance) -> None:
    """Lash line, wet rims and the sockets behind the eyes."""
    lids = _lids(atlas)
    darken(color, lids.lashes, lids.line * np.float32(0.65 + 0.7 * look.lashes), (0.85, 0.95, 1.0))
    rim = skin_tone(look.melanin) * [0.80, 0.58, 0.55]
    put(color, lids.socket, mix(rim, np.array([0.16, 0.06, 0.05]), lids.depth))

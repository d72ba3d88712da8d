# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a head: skin, lips, brows, beard, lids, mouth and teeth in the atlas.

Positions are decimetres on the base mesh: eyes at (±0.31, 7.28), nose tip at
(0, 6.91), lips meeting at 6.61, chin at 6.2, hairline about 8.0.
"""

from __future__ import annotations

import numpy as np
from PIL import Image

from generator.heads.parametric.appearance import Appearance, hair_tone, skin_tone
from generator.heads.parametric.atlas import ATLAS_SIZE, Atlas
from generator.heads.parametric.hair import paint_hair
from generator.heads.parametric.noise import smooth_noise, smoothstep

_BROW_T = np.array([0.0, 0.12, 0.35, 0.62, 0.82, 1.0])
_BROW_Y = np.array([7.452, 7.462, 7.480, 7.494, 7.484, 7.448])
_BROW_HALF = np.array([0.020, 0.038, 0.038, 0.030, 0.019, 0.006])
_BROW_LEAN = np.deg2rad([80, 62, 35, 12, -12, -30])
_BROW_INNER, _BROW_LENGTH = 0.105, 0.43


def paint_skin(atlas: Atlas, look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """skin.png as sRGB uint8 [ATLAS_SIZE, ATLAS_SIZE, 3]. atlas: of any mesh of a head."""
    tone = skin_tone(look.melanin).astype(np.float32)
    color = _complexion(atlas, look, tone, rng)
    _spots(color, atlas, look, rng)
    _age(color, atlas, look, rng)
    _lips(color, atlas, look, tone, rng)
    _shade(color, atlas)
    _beard(color, atlas, look, rng)
    _brows(color, atlas, look, rng)
    paint_hair(color, atlas, look, rng)
    _lids(color, atlas, look)
    _mouth(color, atlas, look, tone)
    color *= 1 + 0.012 * rng.standard_normal((ATLAS_SIZE, ATLAS_SIZE, 1), dtype=np.float32)
    return (np.clip(color, 0, 1) * 255 + 0.5).astype(np.uint8)


def _complexion(atlas: Atlas, look: Appearance, tone: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Base tone, blotches and blood."""
    coarse = atlas.points[::4, ::4]
    blotch = 0.6 * smooth_noise(rng, tuple(np.moveaxis(coarse * 6.0, -1, 0)))
    blotch += 0.4 * smooth_noise(rng, tuple(np.moveaxis(coarse * 17.0, -1, 0)))
    x, y, z = np.moveaxis(coarse, -1, 0)
    side = np.abs(x)

    def around(cx: float, cy: float, cz: float, size: float) -> np.ndarray:
        return np.exp(-((side - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2) / (2 * size**2))

    blood = 0.8 * around(0.40, 6.95, 1.28, 0.17) + 0.7 * around(0.0, 6.92, 1.66, 0.09)
    blood += 0.45 * around(0.10, 6.88, 1.55, 0.08) + 0.4 * around(0.0, 6.30, 1.48, 0.14)
    blood += 0.6 * atlas.ears[::4, ::4] + 0.25 * around(0.31, 7.36, 1.38, 0.10)
    blood = blood * look.redness + 0.35 * look.mottle * blotch
    # Darker, bluish hollows below the eyes; a slightly darker jaw and neck.
    hollow = (0.5 + 0.5 * look.ageing) * around(0.27, 7.17, 1.37, 0.085)
    warm = np.array([0.03, -0.055, -0.05]) * (1.15 - look.melanin)
    fields = [
        blood[..., None] * warm,
        (0.030 * look.mottle * blotch - 0.07 * smoothstep(6.35, 6.05, y))[..., None] * np.ones(3),
        -hollow[..., None] * np.array([0.075, 0.085, 0.055]),
    ]
    change = np.asarray(sum(fields), dtype=np.float32)
    return tone * (1 + _enlarge(change))


def _spots(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Freckles and moles, as small discs about points of the skin."""
    bare = atlas.is_part("skin") & (atlas.lips < 0.1) & (atlas.lid > 0.05)
    front = np.argwhere(bare & (atlas.points[..., 2] > 0.9))
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
        color[window] *= 1 - mark[..., None] * np.array([0.6, 0.85, 1.0], dtype=np.float32)


def _age(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    """Lines on the forehead, beside the eyes and beside the mouth."""
    if look.ageing < 0.12:
        return
    _, height, front = np.moveaxis(atlas.points, -1, 0)
    face = np.nonzero(atlas.is_part("skin") & (front > 0.75) & (height > 6.45) & (height < 8.0))
    x, y, _ = atlas.points[face].T
    side = np.abs(x)
    warp = 0.03 * smooth_noise(rng, (x * 4 + 9, y * 4))
    forehead = smoothstep(0.72, 1.0, np.cos((y + warp + 0.05 * x**2) * 2 * np.pi / 0.115))
    forehead *= smoothstep(7.56, 7.66, y) * smoothstep(7.98, 7.86, y) * smoothstep(0.5, 0.3, side)
    outwards, up = side - 0.45, y - 7.27
    turn = np.arctan2(up, outwards + 0.03)
    crow = smoothstep(0.7, 1.0, np.cos(turn * 5 + warp * 40)) * smoothstep(1.1, 0.7, np.abs(turn))
    crow *= smoothstep(0.0, 0.04, outwards) * smoothstep(0.17, 0.06, outwards)
    fold_x = np.interp(y, [6.50, 6.62, 6.75, 6.90], [0.335, 0.325, 0.265, 0.185])
    fold = np.exp(-(((side - fold_x) / 0.016) ** 2)) * smoothstep(6.46, 6.60, y) * smoothstep(6.93, 6.84, y)
    lines = look.ageing * (0.11 * forehead + 0.08 * crow + 0.15 * fold)
    color[face] *= 1 - lines[:, None] * np.array([0.75, 1.0, 1.0], dtype=np.float32)


def _lips(
    color: np.ndarray, atlas: Atlas, look: Appearance, tone: np.ndarray, rng: np.random.Generator
) -> None:
    where = np.nonzero(atlas.lips > 0.01)
    points = atlas.points[where]
    light = float(tone @ [0.3, 0.59, 0.11])
    tint = np.array([0.85, 0.62, 0.64]) + look.melanin * np.array([-0.05, 0.10, 0.18])
    natural = tone * tint + look.lip_red * light * np.array([0.03, -0.04, -0.02])
    paint = np.array([rng.uniform(0.45, 0.75), rng.uniform(0.10, 0.28), rng.uniform(0.16, 0.32)])
    lip = natural + (paint - natural) * look.lip_makeup
    creases = smooth_noise(rng, (points[:, 0] * 70, points[:, 1] * 6))
    lip = lip * (1 + 0.05 * creases)[:, None]
    strength = atlas.lips[where] * max(look.lip_color, look.lip_makeup)
    color[where] += (lip - color[where]) * strength[:, None]
    seam = smoothstep(0.035, 0.004, atlas.lip_seam)
    color *= 1 - (0.45 * seam * atlas.is_part("skin"))[..., None]


def _shade(color: np.ndarray, atlas: Atlas) -> None:
    """Ambient occlusion, red where light comes through skin."""
    shadow = np.minimum(atlas.occlusion * (1 - 0.75 * atlas.lips), 0.75) * atlas.is_part("skin")
    color *= 1 - shadow[..., None] * np.array([0.85, 1.05, 1.10], dtype=np.float32)
    nostril = np.linalg.norm(np.abs(atlas.points) - np.array([0.09, 6.865, 1.55], dtype=np.float32), axis=-1)
    dark = smoothstep(0.06, 0.025, nostril) * atlas.is_part("skin") * smoothstep(0.15, 0.4, atlas.occlusion)
    color *= 1 - (0.55 * dark)[..., None]


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


def _beard(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    if look.beard == "none":
        return
    near = np.nonzero(atlas.is_part("skin") & (atlas.points[..., 1] < 7.3) & (atlas.points[..., 2] > 0.4))
    points = atlas.points[near]
    cover = beard_cover(points, look.beard) * (1 - smoothstep(0.1, 0.5, atlas.lips[near]))
    x, y, z = points.T
    hairs = smooth_noise(rng, (np.arctan2(x, z - 0.35) * 70, y * 24))
    grain = rng.standard_normal(len(points), dtype=np.float32)
    if look.beard == "stubble":
        alpha = cover * (0.12 + 0.28 * look.beard_density) * (1 + 0.35 * hairs + 0.15 * grain)
    else:
        alpha = smoothstep(0.12, 0.75, cover + 0.28 * hairs) * (0.62 + 0.33 * look.beard_density)
    tone = hair_tone(look) * 1.05
    hair = tone * (1 + 0.4 * hairs + 0.08 * grain)[:, None]
    color[near] += (hair - color[near]) * np.clip(alpha, 0, 1)[:, None]


def _brows(color: np.ndarray, atlas: Atlas, look: Appearance, rng: np.random.Generator) -> None:
    near = np.nonzero(
        atlas.is_part("skin")
        & (np.abs(atlas.points[..., 1] - 7.46) < 0.16)
        & (atlas.points[..., 2] > 0.9)
        & (np.abs(atlas.points[..., 0]) < 0.65)
    )
    x, y, _ = atlas.points[near].T
    side = np.abs(x)
    place = (side - _BROW_INNER) / _BROW_LENGTH
    t = np.clip(place, 0, 1)
    line = np.interp(t, _BROW_T, _BROW_Y) + look.brow_height
    half = np.interp(t, _BROW_T, _BROW_HALF) * look.brow_width
    lean = np.interp(t, _BROW_T, _BROW_LEAN)
    across = (y - line) / half
    # Hairs lean from upright at the nose to flat at the temple; both brows differ.
    along = side * np.cos(lean) + y * np.sin(lean) + 2.0 * (x > 0)
    beside = -side * np.sin(lean) + y * np.cos(lean)
    hairs = smooth_noise(rng, (along * 14, beside * 120))
    ends = smoothstep(-0.05, 0.08, place) * smoothstep(1.06, 0.85, place)
    cover = smoothstep(1.25, 0.45, np.abs(across) + 0.45 * hairs) * ends
    tone = hair_tone(look) * 0.85
    tone *= min(1.0, 0.45 / tone.max())
    alpha = look.brow_density * cover * (0.80 + 0.2 * hairs)
    color[near] += (tone - color[near]) * np.clip(alpha, 0, 1)[:, None]


def _lids(color: np.ndarray, atlas: Atlas, look: Appearance) -> None:
    """Lash line, wet rims and the sockets behind the eyes."""
    skin = atlas.is_part("skin")
    upper = smoothstep(7.255, 7.31, atlas.points[..., 1])
    line = smoothstep(0.034, 0.006, atlas.lid) * skin * (0.30 + 0.60 * upper) * (0.65 + 0.7 * look.lashes)
    color *= 1 - line[..., None] * np.array([0.85, 0.95, 1.0], dtype=np.float32)
    socket = np.nonzero(atlas.is_part("socket_left", "socket_right"))
    depth = smoothstep(0.0, 0.10, atlas.lid[socket])[:, None]
    rim = skin_tone(look.melanin) * [0.80, 0.58, 0.55]
    color[socket] = rim + (np.array([0.16, 0.06, 0.05]) - rim) * depth


def _mouth(color: np.ndarray, atlas: Atlas, look: Appearance, tone: np.ndarray) -> None:
    inside = np.nonzero(atlas.is_part("mouth"))
    depth = smoothstep(0.0, 0.15, atlas.lip_seam[inside])[:, None]
    wet = tone * [0.48, 0.24, 0.24]
    color[inside] = wet + (np.array([0.075, 0.022, 0.022]) - wet) * depth

    tongue = np.nonzero(atlas.is_part("tongue"))
    back = smoothstep(1.36, 1.05, atlas.points[tongue][:, 2])[:, None]
    color[tongue] = np.array([0.60, 0.30, 0.29]) * (1 - 0.75 * back)

    enamel = np.array([0.87, 0.83, 0.74]) * (1 - 0.12 * look.ageing)
    gum = np.array([0.55, 0.27, 0.26])
    for name, low, high in (("upper_teeth", 6.735, 6.70), ("lower_teeth", 6.56, 6.60)):
        teeth = np.nonzero(atlas.is_part(name))
        x, y, z = atlas.points[teeth].T
        turn = np.arctan2(x, z - 1.1)
        gap = np.abs((turn / 0.27 + 0.5) % 1 - 0.5)
        tooth = smoothstep(low, high, y)
        crown = enamel * (1 - 0.40 * smoothstep(0.44, 0.5, 0.5 - gap))[:, None]
        dark = 1 - 0.85 * smoothstep(0.45, 0.8, np.abs(turn))
        color[teeth] = (gum + (crown - gum) * tooth[:, None]) * dark[:, None]


def _enlarge(field: np.ndarray) -> np.ndarray:
    """A quarter-size field [h, w, 3] at full size, bilinear."""
    planes = [
        Image.fromarray(np.ascontiguousarray(field[..., k]), mode="F").resize(
            (ATLAS_SIZE, ATLAS_SIZE), Image.Resampling.BILINEAR
        )
        for k in range(field.shape[-1])
    ]
    return np.stack([np.asarray(plane) for plane in planes], axis=-1)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen when a mouth opens, in the atlas: walls, tongue, gums and teeth."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from generator.heads.parametric.appearance import Appearance
from generator.heads.parametric.atlas import ATLASES, Atlas
from generator.heads.parametric.layers import mix, put
from generator.heads.parametric.noise import smoothstep

_GUM = np.array([0.55, 0.27, 0.26])


class _Mouth(NamedTuple):
    walls: np.ndarray
    depth: np.ndarray
    tongue: np.ndarray
    tongue_color: np.ndarray
    teeth: np.ndarray
    gums: np.ndarray  # colour [3, K] of the gums where they show
    crowns: np.ndarray  # share [K] of a tooth's enamel


@lru_cache(maxsize=ATLASES)
def _mouth(atlas: Atlas) -> _Mouth:
    walls, tongue = (np.flatnonzero(atlas.is_part(name)) for name in ("mouth", "tongue"))
    back = smoothstep(1.36, 1.05, atlas.texels(tongue)[:, 2])
    teeth, gums, crowns = [], [], []
    for name, low, high in (("upper_teeth", 6.735, 6.70), ("lower_teeth", 6.56, 6.60)):
        where = np.flatnonzero(atlas.is_part(name))
        x, y, z = atlas.texels(where).T
        turn = np.arctan2(x, z - 1.1)
        gap = np.abs((turn / 0.27 + 0.5) % 1 - 0.5)
        tooth = smoothstep(low, high, y)
        dark = 1 - 0.85 * smoothstep(0.45, 0.8, np.abs(turn))
        teeth.append(where)
        gums.append(_GUM[:, None] * ((1 - tooth) * dark))
        crowns.append((1 - 0.40 * smoothstep(0.44, 0.5, 0.5 - gap)) * tooth * dark)
    return _Mouth(
        walls=walls,
        depth=smoothstep(0.0, 0.15, atlas.lip_seam.ravel()[walls]),
        tongue=tongue,
        tongue_color=np.array([[0.60], [0.30], [0.29]]) * (1 - 0.75 * back),
        teeth=np.concatenate(teeth),
        gums=np.concatenate(gums, axis=1),
        crowns=np.concatenate(crowns),
    )


def paint_mouth(color: np.ndarray, atlas: Atlas, look: Appearance, tone: np.ndarray) -> None:
    """Paint the inside of the mouth into color float32 [3, N], in place. tone: sRGB [3] of the skin."""
    mouth = _mouth(atlas)
    put(color, mouth.walls, mix(tone * [0.48, 0.24, 0.24], np.array([0.075, 0.022, 0.022]), mouth.depth))
    put(color, mouth.tongue, mouth.tongue_color)
    enamel = np.array([0.87, 0.83, 0.74]) * (1 - 0.12 * look.ageing)
    put(color, mouth.teeth, mouth.gums + enamel[:, None] * mouth.crowns)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What of ICT-FaceKit's mesh the shared paint knows nothing of: gums, teeth and lashes."""

from __future__ import annotations

import numpy as np

from generator.heads.ict.atlas import GUMS, TEETH
from generator.heads.parametric.appearance import Appearance, hair_tone
from generator.heads.parametric.atlas import Atlas
from generator.heads.parametric.noise import smoothstep

LASH_SIZE = (64, 256)
"""Texels of lash.png, rows and columns."""

_LASHES = 18
"""Of a card."""


def paint_teeth(pixels: np.ndarray, atlas: Atlas, look: Appearance) -> None:
    """Paint gums, tongue and teeth into skin.png, uint8 [H, W, 3], in place: darker towards the throat."""
    light = smoothstep(1.10, 1.43, atlas.points[..., 2])[..., None]
    enamel = np.array([0.87, 0.83, 0.74]) * (1 - 0.12 * look.ageing)
    for part, front, back in (
        (GUMS, np.array([0.57, 0.28, 0.27]), np.array([0.10, 0.035, 0.035])),
        (TEETH, enamel, 0.25 * enamel),
    ):
        where = atlas.part == part
        pixels[where] = (255 * (back + (front - back) * light[where]) + 0.5).astype(np.uint8)


def paint_lashes(look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """A row of lashes that grow from the lower edge, sRGB with alpha, uint8 [H, W, 4]."""
    height, width = LASH_SIZE
    up = 1 - (np.arange(height)[:, None] + 0.5) / height
    across = (np.arange(width)[None, :] + 0.5) / width
    alpha = np.zeros(LASH_SIZE)
    for k in range(_LASHES):
        root = (k + rng.uniform(0.2, 0.8)) / _LASHES
        length = min(1.0, 1.4 * look.lashes * rng.uniform(0.75, 1.0))
        lean = rng.normal(0, 0.02)
        along = up / length
        middle = root + lean * along**2
        half = 0.007 * np.clip(1 - along, 0, 1) + 1e-4
        alpha = np.maximum(alpha, smoothstep(1.3, 0.6, np.abs(across - middle) / half) * (along < 1))
    color = np.broadcast_to(np.minimum(hair_tone(look) * 0.6, 0.12), (*LASH_SIZE, 3))
    return (np.concatenate([color, alpha[..., None]], axis=2) * 255 + 0.5).astype(np.uint8)

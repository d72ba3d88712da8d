# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and patterns of clothes, and the folds that they throw."""

from __future__ import annotations

import numpy as np

from generator.worn.torso import ANGLES

COLORS = (
    (0.91, 0.91, 0.90), (0.09, 0.09, 0.10), (0.24, 0.25, 0.28), (0.55, 0.56, 0.58), (0.10, 0.14, 0.27),
    (0.19, 0.30, 0.47), (0.48, 0.60, 0.72), (0.47, 0.10, 0.12), (0.72, 0.22, 0.18), (0.16, 0.30, 0.21),
    (0.40, 0.42, 0.26), (0.74, 0.66, 0.52), (0.44, 0.31, 0.21), (0.84, 0.72, 0.30), (0.78, 0.50, 0.54),
    (0.36, 0.22, 0.40), (0.20, 0.45, 0.48), (0.93, 0.87, 0.76),
)  # fmt: skip
"""sRGB."""

SHIRTS = ((0.93, 0.93, 0.94), (0.93, 0.93, 0.94), (0.68, 0.77, 0.88), (0.86, 0.80, 0.84), (0.20, 0.22, 0.28))
SUITS = ((0.08, 0.09, 0.12), (0.13, 0.15, 0.22), (0.22, 0.23, 0.25), (0.36, 0.36, 0.37), (0.27, 0.20, 0.16))


def pick(colors: tuple[tuple[float, float, float], ...], rng: np.random.Generator) -> np.ndarray:
    """One of some colours, a little lighter or darker."""
    return np.clip(np.array(colors[int(rng.integers(len(colors)))]) * rng.uniform(0.85, 1.08), 0, 1)


def pattern(
    shape: tuple[int, ...], rng: np.random.Generator, color: np.ndarray, plain: float, *, across: bool = True
) -> np.ndarray:
    """Colours of a sheet, [R, C, 3]: plain as often as said, else striped or checked.

    across: may stripes go around the body?
    """
    rows, columns = np.indices(shape)
    kind, other = rng.uniform(), pick(COLORS, rng)
    wide, thin = int(rng.integers(2, 5)), rng.uniform(0.25, 0.8)
    rings = ((rows // wide) % 2 == 1)[..., None]
    along = ((columns // wide) % 2 == 1)[..., None]
    sheet = np.broadcast_to(color, (*shape, 3))
    if kind < plain:
        return sheet.copy()
    mixed = color + thin * (other - color)
    share = (kind - plain) / (1 - plain)
    if share < 0.45 and across:
        return np.where(rings, mixed, sheet)
    if share < 0.6:
        return np.where(along, mixed, sheet)
    return color + (0.5 * rings + 0.5 * along) * (mixed - color)


def folds(reach: np.ndarray, height: np.ndarray, rng: np.random.Generator, size: float) -> np.ndarray:
    """How far cloth stands off for its folds, [R, COLUMNS] of some mm; none at the collar."""
    rows = len(reach)
    down = np.linspace(0, 1, rows)[:, None]
    waves = np.zeros_like(reach)
    for _ in range(7):
        around, along = int(rng.integers(2, 8)), rng.uniform(-14, 14)
        waves += rng.normal() * np.sin(around * ANGLES + along * down + rng.uniform(0, 6.3))
    sharp = np.sign(waves) * np.abs(waves) ** 0.8
    return size * sharp / 2.2 * np.minimum(1, 5 * down) * (0.5 + down)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair is gathered to behind the head: a bun or a ponytail."""

from __future__ import annotations

import numpy as np

from generator.worn.cuts import Cut
from generator.worn.growing import DOWN, Locks, knot
from generator.worn.skull import Skull

BUN_LOCKS, TAIL_LOCKS, POINTS = 260, 300, 9
BUN_MM = np.array([33.0, 29.0, 25.0])
"""Half axes: sideways, up, outwards."""


def gathered(skull: Skull, cut: Cut, rng: np.random.Generator) -> Locks:
    """Locks of the bun, or of the tail if the cut has one."""
    out = knot(skull, cut) - skull.centre
    out /= np.linalg.norm(out)
    return _tail(skull, cut, out, rng) if cut.tail else _bun(skull, cut, out, rng)


def _bun(skull: Skull, cut: Cut, out: np.ndarray, rng: np.random.Generator) -> Locks:
    """Locks wound around a ball, the outer ones loosely."""
    side = np.cross(out, DOWN)
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(side, out), out])
    half = BUN_MM * skull.scale * rng.uniform(0.8, 1.15)
    layer = rng.uniform(0, 1, BUN_LOCKS)
    # Rings about the way out, tilted a little: what is wound.
    height = np.sin(rng.uniform(-0.35, 1.45, BUN_LOCKS))[:, None]
    turn = rng.uniform(0, 2 * np.pi, BUN_LOCKS)[:, None] + np.linspace(0, 1.9, POINTS)
    tilt = 0.35 * np.sin(turn + rng.uniform(0, 2 * np.pi)) + 0.05 * rng.normal(size=(BUN_LOCKS, 1))
    height = np.clip(height + tilt * np.sqrt(1 - height**2), -0.6, 1)
    ring = np.sqrt(1 - height**2)
    ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=-1)
    loose = 1 + 0.09 * (layer[:, None] - 0.5) + 0.05 * np.linspace(0, 1, POINTS) ** 3 * layer[:, None]
    points = knot(skull, cut) + 0.55 * half[2] * out + (ball * loose[..., None] * half) @ axes
    return Locks(points, layer)


def _tail(skull: Skull, cut: Cut, out: np.ndarray, rng: np.random.Generator) -> Locks:
    """Locks that leave the head and hang."""
    flat = out * [1, 0, 1] / np.linalg.norm(out * [1, 0, 1])
    count, along = TAIL_LOCKS, np.linspace(0, 1, POINTS)[None, :, None]
    length = cut.tail * skull.scale * rng.uniform(0.72, 1.05, count)[:, None, None]
    spread = rng.normal(size=(count, 3)) * [1, 0.5, 0.8]
    layer = np.clip(np.linalg.norm(spread, axis=1) / 2.5, 0, 1)
    side = np.array([rng.normal(0, 0.05), 0.0, 0.0])
    away = out * 14 + flat * 30 * rng.uniform(0.8, 1.2)
    leaves = (1 - np.exp(-5 * along)) * away * skull.scale
    falls = (along - 0.2 * (1 - np.exp(-5 * along))) * length * (DOWN + side)
    width = (5 + 17 * np.sqrt(along) * (1 - 0.55 * along)) * skull.scale
    sway = 3 * skull.scale * np.sin(5 * along + rng.uniform(0, 6.3, (count, 1, 1))) * along
    return Locks(knot(skull, cut) + leaves + falls + width * spread[:, None] + sway * [1.0, 0.0, 0.5], layer)

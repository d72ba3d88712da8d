# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes by their style: collars, and what is below them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from generator.worn.fabric import COLORS, SHIRTS, SUITS, folds, pattern, pick
from generator.worn.strips import Piece
from generator.worn.torso import ANGLES, COLUMNS, Torso, grid

ROWS = 48
_FRONT = np.minimum(ANGLES, 2 * np.pi - ANGLES)
"""Angle from the front to either side."""


def crew(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A T-shirt or a pullover with a ribbed band around the neck."""
    color = pick(COLORS, rng)
    low = rng.uniform(0.0, 1.3)
    reach, height = _cloth(torso, rng, 2.2, 3.0)
    colors = pattern(reach.shape, rng, color, 0.6)
    first = 1 + round(low)
    reach, height, colors = reach[first:], height[first:], colors[first:]
    colors[:2] = color * rng.uniform(0.7, 1.0)
    return [_body(*_edged(torso, reach, height, colors))]


def turtleneck(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A pullover whose collar is folded over."""
    color = pick(COLORS, rng)
    reach, height = _cloth(torso, rng, 3.0, 4.0)
    pieces = [_body(torso.points(reach, height), pattern(reach.shape, rng, color, 0.8))]
    top = height[0] + torso.scale * rng.uniform(24, 34)
    rows = np.linspace(0, 1, 12)[:, None]
    tall = top + (height[2] - top) * rows
    bulge = np.sin(np.pi * np.clip(rows * 1.25, 0, 1)) ** 0.6
    around = torso.body(tall)
    ribs = 0.5 * np.cos(COLUMNS / 2 * ANGLES) * torso.scale
    tube = around + torso.scale * (2.5 + 6.0 * bulge) + ribs * bulge
    pieces.append(grid(*_edged(torso, tube, tall, np.broadcast_to(color * 0.96, (*tube.shape, 3)))))
    return pieces


def shirt(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A shirt, its collar open or closed."""
    color = pick(SHIRTS if rng.random() < 0.6 else COLORS, rng)
    wide = rng.uniform(0.15, 0.6)
    return _shirt(torso, rng, color, wide, plain=0.5)


def hoodie(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A pullover with a hood that lies on the back."""
    color = pick(COLORS, rng)
    reach, height = _cloth(torso, rng, 5.0, 6.0)
    pieces = [_body(torso.points(reach, height), color)]
    turn = np.linspace(0, 2 * np.pi, 15)[:, None]
    # A thick roll around the neck, thin and low in front, thick behind.
    behind = np.sin(_FRONT / 2) ** 1.5
    thick = torso.scale * (7 + 22 * behind) * (1 + 0.07 * np.sin(5 * ANGLES + rng.uniform(0, 6)))
    middle = height[2] + torso.scale * (3 + 14 * behind)
    out = torso.body(middle[None])[0] + thick * 0.95
    out = out + torso.scale * (2 + 6 * behind)
    tube = out + thick * np.cos(turn)
    lies = middle + 0.8 * thick * np.sin(turn) - 0.35 * thick * np.cos(turn)
    pieces.append(grid(torso.points(tube, lies)[::-1], np.broadcast_to(color * 0.93, (*tube.shape, 3))))
    return pieces


def suit(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A jacket over a shirt, mostly with a tie."""
    pieces = _shirt(torso, rng, pick(SHIRTS, rng), 0.03, plain=0.8, rows=round(0.66 * ROWS))
    color = pick(SUITS, rng)
    reach, height = _cloth(torso, rng, 9.0, 4.0)
    down = np.linspace(0, 1, ROWS)
    # Open in front, from the sides of the neck to the lowest button.
    opening = np.radians(58) * np.clip(1 - down * 1.7, 0, 1) ** 0.8
    points = _from(torso, reach, height, opening)
    pieces.append(_body(points[2:], color, closed=False))
    pieces += _lapels(torso, reach, height, opening, color)
    if rng.random() < 0.8:
        pieces += _tie(torso, rng)
    return pieces


GARMENTS: dict[str, Callable[[Torso, np.random.Generator], list[Piece]]] = {
    "crew": crew, "shirt": shirt, "turtleneck": turtleneck, "hoodie": hoodie, "suit": suit,
}  # fmt: skip
"""By style: (torso, rng) -> pieces."""


def _cloth(
    torso: Torso, rng: np.random.Generator, lift: float, fold: float, most: float = 9.0
) -> tuple[np.ndarray, np.ndarray]:
    reach, height = torso.surface(ROWS, lift)
    waves = folds(reach, height, rng, fold * torso.scale)
    return reach + np.clip(waves, -0.6 * lift * torso.scale, most * torso.scale), height


def _body(points: np.ndarray, colors: np.ndarray, *, closed: bool = True) -> Piece:
    """The sheet of a garment through points [R, C, 3], with a floor: nobody looks into it from below."""
    floor = np.broadcast_to(points[-1].mean(axis=0), (1, *points.shape[1:]))
    colors = np.broadcast_to(colors, points.shape)
    return grid(
        np.concatenate([points, points[-1:], floor]),
        np.concatenate([colors, 0.4 * colors[-1:], 0.4 * colors[-1:]]),
        closed=closed,
    )


def _edged(
    torso: Torso, reach: np.ndarray, height: np.ndarray, colors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points and colours of a sheet whose upper edge turns inwards, so that it has a thickness."""
    inner = np.stack([reach[0] - 5 * torso.scale, reach[0] - 1.2 * torso.scale])
    above = np.stack([height[0] - 5 * torso.scale, height[0] + 1.6 * torso.scale])
    dark = np.stack([0.5 * colors[0], 0.9 * colors[0]])
    points = torso.points(np.concatenate([inner, reach]), np.concatenate([above, height]))
    return points, np.concatenate([dark, colors])


def _shirt(
    torso: Torso, rng: np.random.Generator, color: np.ndarray, wide: float, plain: float, rows: int = ROWS
) -> list[Piece]:
    scale = torso.scale
    reach, height = _cloth(torso, rng, 1.5, 2.5, 3.0)
    colors = pattern(reach.shape, rng, color, plain, across=False)
    # Columns at the front overlap where it is buttoned.
    colors[:, [1, COLUMNS - 2]] *= 0.9
    down = np.linspace(0, 1, ROWS)
    opening = np.radians(34) * wide * np.clip(1 - down * 5.6, 0, 1)
    points = _from(torso, reach, height, opening)
    colors = np.concatenate([colors, colors[:, :1]], axis=1)
    pieces = [_body(points[:rows], colors[:rows], closed=False)]
    # The leaf of the collar: up the neck, then folded outwards and down, its points in front.
    front = np.cos(_FRONT / 2) ** 6
    stand = height[0] + scale * (20 - 12 * front)
    tip = height[0] - scale * (4 + 24 * front)
    out = np.array([1.5, 3.5, 5.0, 8.0, 12.0, 15.0])[:, None] * scale
    share = np.array([-0.5, 0.6, 1.0, 0.75, 0.35, 0.0])[:, None]
    leaf = tip + (stand - tip) * share
    around = torso.body(leaf)
    base = np.maximum(around, np.where(share < 0.6, reach[1] + 1.0 * scale, 0))
    spread = np.radians(5 + 26 * wide) * np.ones(6)
    folded = _from(torso, base + out * (0.4 + 0.6 * (share < 0.9)), leaf, spread)
    tone = np.broadcast_to(color * 1.02, folded.shape)
    pieces.append(grid(folded, tone * np.linspace(0.8, 1, 6)[:, None, None], closed=False))
    return pieces


def _from(torso: Torso, reach: np.ndarray, height: np.ndarray, opening: np.ndarray) -> np.ndarray:
    """Points [R, COLUMNS + 1, 3] of a sheet that is open in front by an angle to both sides, [R]."""
    share = np.linspace(0, 1, COLUMNS + 1)
    angle = opening[:, None] + (2 * np.pi - 2 * opening[:, None]) * share
    around = np.append(ANGLES, 2 * np.pi)
    points = np.empty((len(reach), COLUMNS + 1, 3))
    for row in range(len(reach)):
        far = np.interp(angle[row], around, np.append(reach[row], reach[row, 0]))
        high = np.interp(angle[row], around, np.append(height[row], height[row, 0]))
        x, z = torso.axis[0] + far * np.sin(angle[row]), torso.axis[1] + far * np.cos(angle[row])
        points[row] = np.stack([x, high, z], axis=1)
    return points


def _lapels(
    torso: Torso, reach: np.ndarray, height: np.ndarray, opening: np.ndarray, color: np.ndarray
) -> list[Piece]:
    """A leaf along each edge of a jacket's opening, with a notch."""
    rows = np.arange(2, int(ROWS * 0.58))
    share = np.linspace(0, 1, len(rows))
    width = np.radians(17) * np.sin(np.pi * np.clip(0.12 + 0.88 * share, 0, 1)) ** 0.7
    width *= np.where(np.abs(share - 0.3) < 0.035, 0.62, 1.0)
    pieces = []
    for side in (1, -1):
        leaf = []
        for part in np.linspace(0, 1, 4):
            angle = (side * (opening[rows] - np.radians(1) + part * width)) % (2 * np.pi)
            far = np.array(
                [
                    np.interp(a, ANGLES, reach[row], period=2 * np.pi)
                    for a, row in zip(angle, rows, strict=True)
                ]
            )
            high = np.array(
                [
                    np.interp(a, ANGLES, height[row], period=2 * np.pi)
                    for a, row in zip(angle, rows, strict=True)
                ]
            )
            far = far + torso.scale * (1.5 + 4.0 * np.sin(np.pi * (0.15 + 0.6 * part)))
            x, z = torso.axis[0] + far * np.sin(angle), torso.axis[1] + far * np.cos(angle)
            leaf.append(np.stack([x, high, z], axis=1))
        sheet = np.stack(leaf, axis=1)
        sheet = sheet if side > 0 else sheet[:, ::-1]
        pieces.append(grid(sheet, np.broadcast_to(color * 1.06 + 0.005, sheet.shape), closed=False))
    return pieces


def _tie(torso: Torso, rng: np.random.Generator) -> list[Piece]:
    """A knot and what hangs from it, before the shirt."""
    color, other = pick(COLORS, rng), pick(COLORS, rng)
    slant = rng.random() < 0.5
    reach, height = torso.surface(ROWS, 5.0)
    rows = np.arange(0, int(ROWS * 0.6))
    depth = torso.axis[1] + reach[rows, 0]
    down = np.linspace(0, 1, len(rows))
    knot = np.clip((0.1 - down) / 0.1, 0, 1)
    half = torso.scale * np.where(down < 0.1, 10 + 7 * knot, 9 + 24 * np.clip(down - 0.1, 0, 0.75))
    across = np.linspace(-1, 1, 7)
    x = torso.axis[0] + half[:, None] * across
    bulge = torso.scale * (3 + 5 * (down < 0.1))[:, None] * (1 - across**2)
    points = np.stack([x, np.broadcast_to(height[rows, :1], x.shape), depth[:, None] + bulge], axis=-1)
    bands = (np.arange(len(rows))[:, None] + np.arange(7)) // 3 % 2 == 1
    colors = np.where((bands & slant)[..., None], other, color)
    return [grid(points, colors, closed=False)]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair as geometry: locks that grow from the scalp as they are combed, over an undercoat."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import HAIR
from generator.plan.wear import NOTHING
from generator.worn.complexion import complexion, hair_color, surface_colors
from generator.worn.cuts import Cut, draw_cut
from generator.worn.fit import CannotWear, Fit, Kind
from generator.worn.gathered import gathered
from generator.worn.growing import Level, Locks, grow, smooth
from generator.worn.skull import TURN, Skull, find_skull, is_hair
from generator.worn.strips import Piece, across, join, strips, worn_mesh
from generator.worn.under import Rim

RECEDES = 0.35
"""How often short hair leaves the temples bare."""

COVERS = ("headscarf", "hijab", "balaclava")
"""Headwear that leaves no hair to be seen."""

LOW_KNOT_DEG = -32.0
"""Elevation of where hair is gathered below a rim."""

EDGE_HAIRS = 520
COLUMNS, ROWS = 73, 17
"""Of the undercoat."""

FADE = np.array([0.0, 0.35, 0.8])
"""How much of the undercoat's colour its outermost rows have; the rest is what the head has there."""


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """Hair of a style. Raises CannotWear if a landmark is missing, the head has no scalp or long hair of its
    own, or a headscarf covers it."""
    headwear = fit.others.get("headwear", NOTHING)
    if headwear in COVERS:
        raise CannotWear(f"a {headwear} covers it")
    if style != "long" and any(is_hair(material) for material in fit.mesh.materials):
        raise CannotWear("the head has long hair of its own")
    skull = find_skull(fit)
    cut = draw_cut(style, rng)
    look = complexion(fit)
    color = hair_color(look, rng)
    receding = rng.uniform(0, 8) if cut.hides_little and rng.random() < RECEDES else 0.0
    if not look.painted:
        skull = replace(skull, line=skull.line + _receded(rng.uniform(-1.5, 2.5), receding))
    rim = None if headwear == NOTHING else Rim(fit, skull)
    if rim is not None:
        # What is gathered, is gathered below the rim.
        cut = replace(cut, layer=min(cut.layer, 12.0), knot=min(cut.knot, LOW_KNOT_DEG))
    level = Level(float(fit.at(105, 334)[:, 1].mean()), float(fit.at(152)[0, 1]))
    locks = _grown(fit, (style, rim is None), skull, cut, level, rng)
    if rim is not None:
        seen = ~rim.hides(locks.paths)
        locks = Locks(rim.flattened(locks.paths[seen], locks.layer[seen]), locks.layer[seen])
    pieces = [_undercoat(fit, skull, cut, color, rng, flat=rim is not None)]
    pieces.append(_strips(skull, cut, locks, color, rng))
    if rim is None and cut.points > 2:
        pieces.append(_edge(skull, cut, color, look.forehead, rng))
    if cut.comb == "gather":
        pieces.append(_strips(skull, cut, gathered(skull, cut, rng), color, rng))
    return worn_mesh(
        (Material("worn hair", tuple(color.tolist()), label=HAIR, gloss=cut.gloss), join(pieces))
    )


def _grown(
    fit: Fit, key: tuple[str, bool], skull: Skull, cut: Cut, level: Level, rng: np.random.Generator
) -> Locks:
    """Locks of a cut, which grow alike under any hat; the dice are left as growing leaves them."""
    before = str(rng.bit_generator.state["state"])

    def grown() -> tuple[Locks, Any]:
        return grow(skull, cut, level, rng), rng.bit_generator.state

    locks, rng.bit_generator.state = fit.once(("locks", *key, before), grown)
    return locks


def _receded(front: float, temples: float) -> np.ndarray:
    """How much higher than usual a hairline is in front and at the temples, degrees -> radians, [TURNS]."""
    around = np.abs(np.degrees(TURN))
    there = smooth(52, 30, around)
    return np.radians(front * there + temples * there * smooth(6, 26, around))


def _undercoat(
    fit: Fit, skull: Skull, cut: Cut, color: np.ndarray, rng: np.random.Generator, *, flat: bool
) -> Piece:
    """A dark shell over the scalp, which fades into the skin at the hairline."""
    turn = np.linspace(-np.pi, np.pi, COLUMNS)
    share = np.linspace(0, 1, ROWS) ** 1.6
    line = skull.hairline(turn)
    rise = line[:, None] + (np.pi / 2 - line[:, None]) * share
    thick = (0.7 if flat else min(0.3 * cut.layer - 0.4, 5.0)) * skull.scale
    lift = 0.9 + thick * smooth(0.0, 0.3, share)
    turns = np.broadcast_to(turn[:, None], rise.shape)
    points = skull.point(turns, rise, np.broadcast_to(lift, rise.shape))
    edge = points[:, 0]
    outwards = (edge - skull.centre) / np.linalg.norm(edge - skull.centre, axis=1, keepdims=True)
    skin = surface_colors(fit, edge + 200 * outwards, -outwards)
    skin = np.where(np.isfinite(skin), skin, color)
    shade = 0.62 * (1 + 0.12 * rng.normal(size=rise.shape))
    colors = color * shade[..., None]
    for row, fade in enumerate(FADE):
        colors[:, row] = skin + fade * (colors[:, row] - skin)
    grid = np.arange(COLUMNS * ROWS).reshape(COLUMNS, ROWS)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Piece(points.reshape(-1, 3), triangles, colors.reshape(-1, 3))


def _strips(skull: Skull, cut: Cut, locks: Locks, color: np.ndarray, rng: np.random.Generator) -> Piece:
    count, points = locks.paths.shape[:2]
    normals = skull.normal(locks.paths)
    along = np.linspace(0, 1, points)
    # What lies is flat on the head; what hangs turns every way, or it would be gone seen along it.
    hangs = smooth(10, -20, np.degrees(skull.angles(locks.paths)[1]))
    roll = rng.normal(0, 0.2, count)[:, None] + hangs * rng.normal(0, 0.65, count)[:, None]
    sides = across(locks.paths, normals, roll)
    profile = np.minimum(0.55 + 1.6 * along, 1.0) * (1 - 0.55 * along**2)
    widths = cut.width * skull.scale * rng.uniform(0.6, 1.35, count)[:, None] * profile
    contrast = 1.15 - 0.9 * float(color.mean())
    shade = rng.normal(1, 0.09 * contrast, count) * (1 + 0.33 * contrast * (locks.layer - 1))
    grade = 1.1 + 0.5 * contrast * (np.minimum(1.8 * along, 1) - 1)
    tint = 1 + 0.015 * rng.normal(size=(count, 3))
    colors = color * tint[:, None] * (shade[:, None] * grade)[..., None]
    streak = 1 + rng.normal(0, 0.14 * contrast, (count, 2))
    return strips(locks.paths, sides, widths, colors, np.clip(streak, 0.5, 1.5))


def _edge(skull: Skull, cut: Cut, color: np.ndarray, skin: np.ndarray, rng: np.random.Generator) -> Piece:
    """Fine short hair along the hairline, without which hair begins as a wig does."""
    turn = np.sort(rng.uniform(-np.pi, np.pi, EDGE_HAIRS))
    rise = skull.hairline(turn) + np.radians(rng.normal(0.3, 1.1, EDGE_HAIRS))
    # Combed hair is combed to its roots; other hair lies every way, and more down than up.
    combed = cut.comb != "whorl"
    slope = rng.normal(0.9 if combed else -0.3, 0.35 if combed else 0.8, EDGE_HAIRS)
    length = rng.uniform(5, 13, EDGE_HAIRS)[:, None] * skull.scale / 90 * np.linspace(0, 1, 3)
    aside = rng.normal(0, 0.5, EDGE_HAIRS)[:, None]
    lift = np.array([0.5, 1.7, 1.2]) * skull.scale
    paths = skull.point(turn[:, None] + aside * length, rise[:, None] + slope[:, None] * length, lift)
    sides = across(paths, skull.normal(paths), rng.normal(0, 0.3, (EDGE_HAIRS, 1)))
    widths = skull.scale * rng.uniform(0.6, 1.1, (EDGE_HAIRS, 1)) * np.array([1.0, 0.9, 0.0])
    tone = color * rng.normal(0.85, 0.1, (EDGE_HAIRS, 1))
    colors = np.repeat((tone + 0.2 * (skin - tone))[:, None], 3, axis=1)
    return strips(paths, sides, widths, colors, np.ones((EDGE_HAIRS, 2)))


KIND = Kind(make, minds=("headwear",))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Brows and lashes with depth: short hairs that stand off the skin."""

from __future__ import annotations

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import BROWS
from generator.landmarks.topology import FACE_MESH
from generator.worn.complexion import complexion, natural_hair_color
from generator.worn.fit import CannotWear, Fit, Kind
from generator.worn.skull import UNIT_MM, without_hair
from generator.worn.strips import Piece, across, join, strips, worn_mesh

UPPER, LOWER = (70, 63, 105, 66, 107), (46, 53, 52, 65, 55)
"""Landmarks of a brow at image left, from its tail to its head, along its upper and its lower edge."""

LID = (33, 246, 161, 160, 159, 158, 157, 173, 133)
"""Landmarks of the upper lid of the eye at image left, from the outer to the inner corner."""

HAIRS = {"natural": 170, "thin": 95, "thick": 250}
"""Of each brow."""

LASHES, LASH_MM = 26, 6.0
"""Of each eye, and how long."""

THIN = 0.22
"""Share of the skin's colour in that of a brow's hair."""

FORWARD = np.array([0.0, 0.0, 1.0])


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """Brows of a style, and lashes. Raises CannotWear if a landmark is missing."""
    bald = without_hair(fit)
    sides = bald.at(234, 454)
    scale = float(np.linalg.norm(sides[1] - sides[0])) / UNIT_MM
    if not 0.3 < scale < 3:
        raise CannotWear("its face is not of a head's size")
    look = complexion(bald)
    color = 0.9 * natural_hair_color(look, rng)
    # Brows of the fair and the grey are darker than their hair.
    color = color * np.clip(1.25 - color.mean(), 0.6, 1.0)
    # A hair is thinner than it is drawn, and skin shows between.
    pale = color + THIN * (look.forehead - color)
    count, long, wide = HAIRS[style], rng.uniform(0.85, 1.2), rng.uniform(0.8, 1.2)
    pieces = []
    for side in (-1, 1):
        pieces.append(_brow(bald, side, scale, round(count * rng.uniform(0.85, 1.15)), long, wide, pale, rng))
        pieces.append(_lashes(bald, side, scale, 0.5 * color, rng.uniform(0.35, 1.0), rng))
    material = Material("worn brows", tuple(color.tolist()), label=BROWS)
    return worn_mesh((material, join(pieces)))


def _line(fit: Fit, places: tuple[int, ...], side: int, share: np.ndarray) -> np.ndarray:
    """Points [N, 3] at shares of a line through landmarks at image left, or their mirror images."""
    chosen = places if side < 0 else tuple(FACE_MESH.mirror_pairs()[list(places)].tolist())
    marks = fit.at(*chosen)
    knots = np.linspace(0, 1, len(marks))
    return np.stack([np.interp(share, knots, marks[:, k]) for k in range(3)], axis=1)


def _brow(
    fit: Fit,
    side: int,
    scale: float,
    count: int,
    long: float,
    wide: float,
    color: np.ndarray,
    rng: np.random.Generator,
) -> Piece:
    along = rng.uniform(0.0, 1.0, count) ** 0.9
    # Full in the middle of its height, ragged at its edges, thin at the tail.
    height = (
        0.5
        + (rng.beta(2.2, 2.2, count) - 0.5)
        * (0.34 + 0.36 * np.sin(np.pi * np.clip(along + 0.25, 0, 1)))
        * wide
    )
    upper, lower = _line(fit, UPPER, side, along), _line(fit, LOWER, side, along)
    between = lower + height[:, None] * (upper - lower)
    roots = fit.cast(between + 60 * scale * FORWARD, np.tile(-FORWARD, (count, 1)))
    # A fringe of the head's own, or an edge: what is far from the landmarks is no brow.
    near = np.abs(roots[:, 2] - between[:, 2]) < 8 * scale
    roots = np.where(near[:, None], roots, between)
    outwards = np.array([float(side), 0.0, -0.35])
    rises = np.interp(along, [0.0, 0.35, 0.8, 1.0], [-0.35, 0.15, 0.75, 1.7])
    # Hairs of the upper edge lie down, those of the lower one rise: they meet.
    rises = rises + 0.8 * (0.5 - height) + rng.normal(0, 0.2, count)
    way = outwards + rises[:, None] * np.array([0.0, 1.0, -0.3]) + rng.normal(0, 0.08, (count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    size = scale * long * rng.uniform(4.5, 8.5, count) * np.interp(along, [0, 0.5, 1], [0.7, 1.0, 0.85])
    normal = np.stack([(roots[:, 0] - fit.at(168)[0, 0]) / (70 * scale), 0 * along, 0 * along + 1], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    lift = scale * rng.uniform(0.7, 1.8, count)
    steps = np.array([0.0, 0.4, 0.75, 1.0])
    rise = np.array([0.1, 0.85, 1.0, 0.55])
    paths = roots[:, None] + steps[:, None] * (size[:, None] * way)[:, None]
    paths = paths + rise[:, None] * (lift[:, None] * normal)[:, None]
    sides = across(paths, np.broadcast_to(normal[:, None], paths.shape), rng.normal(0, 0.3, (count, 1)))
    widths = scale * rng.uniform(0.45, 0.8, (count, 1)) * np.array([0.7, 1.0, 0.75, 0.0])
    shade = rng.normal(1, 0.12, (count, 1, 1))
    colors = np.broadcast_to(color * shade, paths.shape)
    return strips(paths, sides, widths, colors, 1 + rng.normal(0, 0.1, (count, 2)))


def _lashes(
    fit: Fit, side: int, scale: float, color: np.ndarray, long: float, rng: np.random.Generator
) -> Piece:
    """Of the upper lid: those of the lower one are thinner than any pixel."""
    share = np.linspace(0.06, 0.94, LASHES) + rng.normal(0, 0.008, LASHES)
    roots = _line(fit, LID, side, share) + 0.25 * scale * FORWARD
    # Long in the outer half, and fanned out.
    full = 0.55 + 0.45 * np.sin(np.pi * (1 - share) ** 0.8)
    size = (scale * long * LASH_MM * full * rng.uniform(0.8, 1.1, LASHES))[:, None, None]
    fan = np.stack([side * (0.75 - 1.05 * share), 0 * share, 0 * share], axis=1)
    out = fan + np.array([0.0, 0.12, 1.0]) + rng.normal(0, 0.06, (LASHES, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    steps, curl = np.array([0.0, 0.5, 1.0])[:, None], np.array([0.0, 0.12, 0.55])[:, None]
    paths = roots[:, None] + size * (steps * out[:, None] + curl * np.array([0.0, 1.0, 0.0]))
    sides = np.broadcast_to(np.array([1.0, 0.0, 0.0]), paths.shape)
    widths = np.broadcast_to(scale * np.array([1.25, 0.6, 0.0]), (LASHES, 3))
    return strips(paths, sides, widths, np.broadcast_to(color, paths.shape), np.ones((LASHES, 2)))


KIND = Kind(make)

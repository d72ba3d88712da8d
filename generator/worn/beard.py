# SPDX-License-Identifier: GPL-3.0-or-later
"""Beards with depth: hairs that lie along the skin and hang, over a thin undercoat, never over the lips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from generator.heads.mesh import HeadMesh, Material
from generator.labels import BEARD
from generator.plan.wear import NOTHING
from generator.worn.complexion import complexion, natural_hair_color
from generator.worn.fit import CannotWear, Fit, Kind
from generator.worn.lower_face import AREAS, GRID, RISES, TURNS, LowerFace, find_lower_face, within
from generator.worn.skull import without_hair
from generator.worn.strips import Piece, across, join, strips, worn_mesh

MOST_TRIANGLES = 18_000
"""Of hairs."""

WIDER = 1.1
"""Lips and what is this close to them, in their own size, have no hair before them."""

GREY = np.array([0.62, 0.61, 0.59])
DOWN = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class Trim:
    """A beard. area: of :data:`generator.worn.lower_face.AREAS`. hairs: a thousand square mm. length, width:
    mm, at the chin. lift: how steeply hair leaves the skin. points: of each hair. cover: how much of the skin
    the undercoat hides. ears: share of its length that it has there. fine: share of the skin's colour in that
    of a hair thinner than a pixel. ragged: degrees within which the area begins."""

    area: str
    hairs: float
    length: float
    width: float
    lift: float
    points: int
    cover: float
    ears: float = 0.5
    fine: float = 0.0
    ragged: float = 2.0


TRIMS = {
    "stubble": Trim("full", 460, 2.8, 0.85, 0.5, 2, 0.5, 0.8, 0.35, 5.0),
    "moustache": Trim("moustache", 900, 11, 1.4, 0.4, 4, 0.75),
    "goatee": Trim("goatee", 330, 13, 1.4, 0.4, 4, 0.75),
    "full": Trim("full", 150, 15, 1.8, 0.4, 4, 0.8),
    "long": Trim("full", 105, 62, 2.6, 0.42, 7, 0.85, 0.22),
}


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """A beard of a style. Raises CannotWear if a landmark is missing or a mask covers it."""
    if fit.others.get("mask", NOTHING) != NOTHING and style != "stubble":
        raise CannotWear("a mask covers it")
    bald = without_hair(fit)
    face, trim = find_lower_face(bald), TRIMS[style]
    look = complexion(bald)
    color = 0.92 * natural_hair_color(look, rng) + np.array([0.012, 0.004, 0.0])
    grey = rng.uniform(0, 0.4) if rng.random() < 0.25 else 0.0
    outline = face.outline(AREAS[trim.area])
    longer, denser = rng.uniform(0.7, 1.3), rng.uniform(0.8, 1.15)
    pieces = [
        _undercoat(face, outline, color, trim.cover * denser, rng),
        _hairs(face, trim, outline, color + trim.fine * (look.cheek - color), grey, longer, denser, rng),
    ]
    return worn_mesh((Material("worn beard", tuple(color.tolist()), label=BEARD), join(pieces)))


def _undercoat(
    face: LowerFace, outline: np.ndarray, color: np.ndarray, cover: float, rng: np.random.Generator
) -> Piece:
    """A thin sheet that darkens the skin, and fades towards its edge."""
    angles, there = GRID, np.isfinite(face.surface).all(axis=-1)
    grows = within(angles, outline) & there & ~face.on_lips(np.where(there[..., None], face.surface, 0), 1.05)
    share = np.clip(gaussian_filter(grows.astype(float), 2.0) * 2 - 0.75, 0, 1) * grows
    share *= 1 + 0.1 * np.clip(rng.normal(size=share.shape), -1.5, 1.5)
    used = grows[:-1, :-1] & grows[1:, :-1] & grows[1:, 1:] & grows[:-1, 1:]
    number = np.arange(TURNS * RISES).reshape(TURNS, RISES)
    a, b, c, d = (part[used] for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    if not len(a):
        raise CannotWear("there is no skin for it")
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    kept, triangles = np.unique(triangles, return_inverse=True)
    flat = angles.reshape(-1, 2)[kept]
    points, share = face.surface.reshape(-1, 3)[kept], share.reshape(-1)[kept]
    skin = face.skin(points)
    skin = np.where(np.isfinite(skin), skin, color)
    # At its edge the sheet is the skin, of the skin's colour.
    border = ~_surrounded(used).reshape(-1)[kept]
    mix = np.where(border, 0.0, np.clip(cover * share, 0, 0.92))[:, None]
    lifted = points + (0.35 + 0.45 * share * face.scale)[:, None] * face.normal(flat)
    return Piece(lifted, triangles.reshape(-1, 3), skin + mix * (0.8 * color - skin))


def _surrounded(used: np.ndarray) -> np.ndarray:
    """Vertices of a grid all of whose four cells are used, bool [TURNS, RISES]."""
    padded = np.pad(used, 1)
    return padded[:-1, :-1] & padded[1:, :-1] & padded[1:, 1:] & padded[:-1, 1:]


def _hairs(
    face: LowerFace,
    trim: Trim,
    outline: np.ndarray,
    color: np.ndarray,
    grey: float,
    longer: float,
    denser: float,
    rng: np.random.Generator,
) -> Piece:
    angles = _roots(face, outline, trim.hairs * denser / 1000, trim.ragged, rng)
    angles = angles[: MOST_TRIANGLES // (2 * trim.points - 3)]
    roots, normals = face.place(angles), face.normal(angles)
    count, scale = len(roots), face.scale
    chin = face.fit.at(152)[0]
    side = np.abs(roots[:, 0] - face.middle[0]) / (60 * scale)
    upper = roots[:, 1] > face.fit.at(13)[0, 1]
    near = np.clip(side, 0, 1)
    size = trim.length * longer * (1 - (1 - trim.ears) * near) * rng.uniform(0.6, 1.2, count)
    # A moustache is as long as there is room for.
    size = np.where(upper & (side < 0.75), np.minimum(size, 9.0 + 4 * rng.uniform(size=count)), size) * scale
    wish = DOWN + np.stack([0.25 * np.sign(roots[:, 0] - face.middle[0]) * near, 0 * near, 0 * near], axis=1)
    sideways = np.sign(roots[:, 0] - face.middle[0]) * (upper & (side < 0.75)) * 1.3
    wish = wish + sideways[:, None] * [1.0, 0.0, -0.25] + 0.22 * rng.normal(size=(count, 3))
    under = roots[:, 1] < chin[1] + 4 * scale
    wish = wish + (under * 0.5)[:, None] * [0.0, 0.0, 1.0]
    lies = wish - (wish * normals).sum(1, keepdims=True) * normals
    lies /= np.maximum(np.linalg.norm(lies, axis=1, keepdims=True), 1e-9)
    leaves = lies + trim.lift * rng.uniform(0.4, 1.5, (count, 1)) * normals
    leaves /= np.linalg.norm(leaves, axis=1, keepdims=True)
    along = np.linspace(0, 1, trim.points)[None, :, None]
    hang = np.clip(size / (45 * scale), 0, 0.8)[:, None, None] * along
    way = (1 - 0.5 * hang) * leaves[:, None] + 0.5 * hang * DOWN
    sway = (
        0.07 * np.sin(4 * along + rng.uniform(0, 6.3, (count, 1, 1))) * rng.normal(size=(count, 1, 3)) * along
    )
    shape = along * (way + sway)
    # Stubble is too short to come out of the undercoat by itself.
    roots = roots + (0.7 if trim.points == 2 else 0.2) * scale * normals
    size = _off_lips(face, roots, shape, size)
    kept = size > 0.35 * trim.length * scale * (0.1 if trim.points > 4 else 0.35)
    paths = roots[kept, None] + size[kept, None, None] * shape[kept]
    sides = across(
        paths, np.broadcast_to(normals[kept, None], paths.shape), rng.normal(0, 0.35, (kept.sum(), 1))
    )
    t = along[..., 0]
    widths = trim.width * scale * rng.uniform(0.6, 1.3, (kept.sum(), 1)) * (1 - 0.6 * t**2)
    shade = rng.normal(1, 0.13, kept.sum())[:, None] * (0.75 + 0.35 * t)
    hair = np.where(rng.random((kept.sum(), 1)) < grey, color + 0.45 * (GREY - color), color)
    colors = hair[:, None] * shade[..., None]
    return strips(paths, sides, widths, colors, 1 + rng.normal(0, 0.12, (kept.sum(), 2)))


def _roots(
    face: LowerFace, outline: np.ndarray, density: float, ragged: float, rng: np.random.Generator
) -> np.ndarray:
    """Azimuth and elevation [N, 2] of hairs, evenly over the skin of an area. density: a square mm."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    tries = 26_000
    angles = low + (high - low) * rng.uniform(size=(tries, 2))
    places = face.place(angles)
    # As dense on the skin as everywhere: how much skin an angle stands for, and how oblique it lies.
    away = places - face.middle
    reach = np.linalg.norm(away, axis=1)
    facing = np.abs((away * face.normal(angles)).sum(axis=1)) / np.maximum(reach, 1e-9)
    area = reach**2 * np.cos(angles[:, 1]) * np.prod(high - low) / tries / np.maximum(facing, 0.25)
    kept = within(angles, outline) & np.isfinite(reach)
    chance = density * np.where(kept, area, 0)
    soft = within(angles + rng.normal(0, np.radians(ragged), angles.shape), outline)
    kept &= soft & (rng.uniform(size=tries) < chance / max(1.0, np.quantile(chance[kept], 0.95)))
    angles = angles[kept]
    return angles[~face.on_lips(face.place(angles), 1.04)]


def _off_lips(face: LowerFace, roots: np.ndarray, shape: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Lengths [N] with which no hair comes before the lips. shape: float64 [N, K, 3], of a mm each."""
    middle = face.lips.mean(axis=0)
    lips = middle + WIDER * (face.lips - middle)
    for _ in range(6):
        over = within(face.angles(roots[:, None] + size[:, None, None] * shape[:, 1:]), lips).any(axis=1)
        if not over.any():
            return size
        size = np.where(over, 0.6 * size, size)
    return np.where(over, 0.0, size)


KIND = Kind(make, minds=("mask",))

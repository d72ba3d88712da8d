# SPDX-License-Identifier: GPL-3.0-or-later
"""Masks over mouth and nose: medical ones with pleats, of cloth, and FFP2, held by loops about the ears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import MASK
from generator.worn.colours import CLOTH, Colour, drawn
from generator.worn.face import Face
from generator.worn.fit import Fit, Kind
from generator.worn.shapes import Part, Shape, assemble, curve, lathe, limb, shell, unit
from generator.worn.wrap import Taut, angles, directions, reach, smoothed, step

NOSE_ROOT, NOSE_TIP, CHIN = 6, 4, 152
SIDES = {-1: (93, 58), 1: (323, 288)}
"""Landmarks before the ears at the height of the nose, and at the angle of the jaw."""

SHEET_MM = 0.7
EDGE_MM = 1.6
"""Of the cloth; of the room below its edge."""

_BLUE, _WHITE, _BLACK = (0.56, 0.74, 0.86), (0.91, 0.92, 0.92), (0.10, 0.10, 0.11)
MEDICAL: dict[Colour, float] = {
    _BLUE: 6, _WHITE: 3, _BLACK: 3, (0.60, 0.80, 0.72): 1, (0.90, 0.72, 0.76): 1,
}  # fmt: skip
FFP2: dict[Colour, float] = {_WHITE: 6, _BLACK: 2, (0.80, 0.82, 0.84): 1}


@dataclass(frozen=True)
class _Style:
    """colours: of its cloth. room_mm: between the taut cloth and its middle. pleats: of its cloth.
    ridge_mm: by how much its middle line stands out. high: share of the way from the tip of the nose to its
    root that it covers. low: share of the way from the cheek to the angle of the jaw that its sides have."""

    colours: dict[Colour, float]
    room_mm: float
    pleats: int
    ridge_mm: float
    high: float
    low: float


STYLES: dict[str, _Style] = {
    "medical": _Style(MEDICAL, 4.0, 3, 0.0, 0.62, 1.3),
    "cloth": _Style(CLOTH, 2.5, 0, 3.0, 0.62, 0.9),
    "ffp2": _Style(FFP2, 7.0, 0, 7.0, 0.70, 0.45),
}

ROWS, COLUMNS = 31, 37


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`."""
    face, kind = Face.of(fit), STYLES[style]
    colour = drawn(kind.colours, rng)
    across, down = np.linspace(-1, 1, COLUMNS)[None], _rows(kind.pleats)[:, None]
    centre, towards = _field(face, across, down, kind)
    surface = reach(face, centre, towards)
    taut = _taut(face, centre, kind).reach(towards)
    surface = np.fmin(np.where(np.isfinite(surface), surface, taut), taut)
    edge = np.minimum(np.minimum(down, 1 - down) * 6, (1 - np.abs(across)) * 5)
    inside = step(edge)
    close = smoothed(surface, (0.8, 0.8)) + EDGE_MM
    room = kind.room_mm * face.scale * (1 - across**2) * np.sin(np.pi * down) ** 0.8
    room = room + kind.ridge_mm * face.scale * np.exp(-((across / 0.28) ** 2)) * np.sin(np.pi * down)
    loose = smoothed(taut, (1.2, 1.2)) + 1.8 + room
    distance = (1 - inside) * np.minimum(close, loose) + inside * loose
    distance = np.maximum(distance, surface + EDGE_MM)
    distance += _pleat(down, kind.pleats) * np.ones_like(across)
    outer = centre + distance[..., None] * towards
    inner = centre + (distance - SHEET_MM)[..., None] * towards
    material = Material(f"mask {style}", colour, label=MASK, gloss=0.05)
    body = shell(outer[::-1], inner[::-1])
    colours = _painted(style, colour, across, down, rng)[::-1].reshape(-1, 3)
    inside_colour = np.broadcast_to(0.35 * np.array(colour) + 0.6 * np.ones(3) * max(colour), colours.shape)
    # A shell goes up outside and down inside, column by column.
    order = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    both = np.concatenate([colours[order], inside_colour[order][::-1]]).swapaxes(0, 1).reshape(-1, 3)
    parts = [Part(body, both, material)]
    strap = tuple(np.clip(0.7 * np.array(colour) + 0.28, 0, 0.95).tolist()) if colour != _BLACK else colour
    elastic = Material("strap", (strap[0], strap[1], strap[2]), label=MASK)
    for side in (-1, 1):
        ends = outer[3, 0 if side < 0 else -1], outer[-4, 0 if side < 0 else -1]
        parts.append(Part(_loop(face, side, *ends), elastic.base_color, elastic))
    if style == "ffp2" and rng.random() < 0.5:
        parts += _valve(outer, colour, 1 if rng.random() < 0.5 else -1)
    return face.back(assemble(parts))


def _rows(pleats: int) -> np.ndarray:
    """Where the rows are, float64 [ROWS], from 0 above to 1 below; two close together at a pleat."""
    rows = np.linspace(0, 1, ROWS - pleats)
    folds = [0.36 + 0.17 * k for k in range(pleats)]
    for fold in folds:
        rows[np.abs(rows - fold).argmin()] = fold
    return np.sort(np.concatenate([rows, np.array(folds) + 0.006]))


def _pleat(down: np.ndarray, pleats: int) -> np.ndarray:
    """How far the cloth stands out of itself: each fold overlaps the next below it."""
    out = np.zeros_like(down)
    for fold in [0.36 + 0.17 * k for k in range(pleats)]:
        behind = down - fold
        out += np.where(behind <= 1e-9, 1.8 * np.exp(-((behind / 0.10) ** 2)), 0.0)
    return out


def _field(face: Face, across: np.ndarray, down: np.ndarray, kind: _Style) -> tuple[np.ndarray, np.ndarray]:
    """A point inside of the head, and the directions in which the mask is seen from there, [M, N, 3].

    across: -1 ... 1 from side to side, [1, N]. down: 0 ... 1, [M, 1].
    """
    root, tip, chin = face.at(NOSE_ROOT, NOSE_TIP, CHIN)
    upper, lower = (np.stack([face.at(*SIDES[side])[k] for side in (-1, 1)]) for k in (0, 1))
    centre = np.array([root[0], 0.5 * (tip[1] + chin[1]), upper[:, 2].mean() - 12.0])
    top = tip + kind.high * (root - tip)
    corner_top = upper + np.array([0, -4.0, 12.0])
    corner_low = upper + kind.low * (lower - upper) + np.array([0, -4.0, 13.0])
    below = chin + np.array([0, -9.0 * face.scale, -16.0 * face.scale])
    turn_top, lift_top = angles(corner_top - centre)
    turn_low, lift_low = angles(corner_low - centre)
    _, highest = angles(top - centre)
    _, lowest = angles(below - centre)
    side = np.abs(across)
    pick = across > 0
    widest = np.where(pick, turn_top[1], -turn_top[0])
    narrow = np.where(pick, turn_low[1], -turn_low[0])
    # Down beside the nose, then along the cheek; below, along the jaw.
    above = highest + (np.where(pick, lift_top[1], lift_top[0]) - highest) * (0.55 * np.sin(
        np.minimum(side * 2.2, 1) * np.pi / 2) ** 2 + 0.45 * side**1.5)  # fmt: skip
    under = lowest + (np.where(pick, lift_low[1], lift_low[0]) - lowest) * side**2.2
    turn = np.sign(across) * side * (widest + (narrow - widest) * down)
    return centre, directions(turn, above + (under - above) * down)


def _taut(face: Face, centre: np.ndarray, kind: _Style) -> Taut:
    """The hull of what the mask covers."""
    across, down = np.linspace(-1.0, 1.0, 49)[None], np.linspace(0.0, 1.0, 45)[:, None]
    _, towards = _field(face, across, down, kind)
    found = centre + reach(face, centre, towards)[..., None] * towards
    points = found.reshape(-1, 3)
    back = centre + np.array([[x, y, -30.0] for x in (-30, 30) for y in (-30, 30)])
    return Taut(np.vstack([points, back]), centre)


def _loop(face: Face, side: int, top: np.ndarray, low: np.ndarray) -> Shape:
    """An elastic from the upper corner of a mask round the back of an ear to its lower corner."""
    skull, ear = face.sides[side], face.sides[side].ear
    middle = 0.45 * ear.front + 0.55 * ear.back
    way = np.array(
        [
            [ear.top - 1.0, middle + 9.0],
            [ear.top - 9.0, middle - 1.0],
            [0.5 * (ear.top + ear.bottom), middle - 5.0],
            [ear.bottom + 12.0, middle + 2.0],
            [ear.bottom + 4.0, middle + 11.0],
        ]
    )
    if not ear.found:  # straight back, under the hair that hides it
        way[:, 0] = np.linspace(top[1], low[1], 5)
    flat = curve(np.vstack([top[1:], way, low[1:]]), 34)
    share = np.linspace(0, 1, len(flat))
    on_skin = skull.at(flat[:, 0], flat[:, 1]) + 1.0
    if not ear.found:  # it is under hair, and so is the loop
        on_skin = np.minimum(on_skin, side * face.at(SIDES[side][0])[0, 0] + 3.0)
    straight = np.interp(share, [0, 0.3, 0.7, 1], [side * top[0], 0, 0, side * low[0]])
    near = np.maximum(np.interp(share, [0, 0.12, 0.88, 1], [1, 0, 0, 1]), 0)
    x = np.maximum(near * straight + (1 - near) * on_skin, on_skin * (near < 1))
    x[0], x[-1] = side * top[0], side * low[0]
    return limb(np.stack([side * x, flat[:, 0], flat[:, 1]], axis=1), 1.0, 6, flat=0.8)


def _valve(outer: np.ndarray, colour: Colour, side: int) -> list[Part]:
    row, column = int(0.56 * ROWS), int((0.5 + 0.2 * side) * COLUMNS)
    place = outer[row, column]
    right, up = (
        outer[row, column + 2] - outer[row, column - 2],
        outer[row - 2, column] - outer[row + 2, column],
    )
    out = unit(np.cross(right, up))
    first = unit(right - (right @ out) * out)
    axes = np.stack([first, np.cross(out, first), out], axis=1)
    outline = [
        (15.5, -3),
        (15.5, 2.0),
        (14.0, 4.0),
        (10.5, 4.6),
        (9.8, 3.6),
        (4.0, 3.8),
        (3.4, 5.0),
        (0.2, 5.2),
    ]
    shade = tuple(np.clip(np.array(colour) * 0.97 + 0.02, 0, 1).tolist())
    plastic = Material("valve", (shade[0], shade[1], shade[2]), label=MASK, gloss=0.35)
    return [Part(lathe(np.array(outline), place, axes, 22), plastic.base_color, plastic)]


def _painted(
    style: str, colour: Colour, across: np.ndarray, down: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """The colours of the cloth, float64 [ROWS, COLUMNS, 3], from above."""
    base = np.broadcast_to(np.array(colour), (ROWS, COLUMNS, 3)).copy()
    if style == "cloth":
        other = np.array(drawn(CLOTH, rng))
        pattern = str(rng.choice(["plain", "plain", "plain", "stripes", "stripes", "checks", "halves"]))
        stripe = np.sin(across * np.pi * 9) > 0.2
        check = stripe ^ (np.sin(down * np.pi * 8) > 0.2)
        chosen = {"stripes": stripe | (down < -1), "checks": check, "halves": (across > 0) & (down > -1)}
        if pattern in chosen:
            base[np.broadcast_to(chosen[pattern], base.shape[:2])] = other
    seam = (down < 0.05) | (down > 0.95) | (np.abs(across) > 0.93)
    shade = 1.0 + (0.10 if style != "cloth" else -0.14) * seam
    if style == "ffp2":
        shade = shade - 0.05 * (np.abs(np.abs(across) - 0.97) < 0.08) - 0.05 * (np.abs(down - 0.08) < 0.02)
    return np.clip(base * shade[..., None], 0, 1)


KIND = Kind(make)

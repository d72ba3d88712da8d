# SPDX-License-Identifier: GPL-3.0-or-later
"""Headphones over the ears, on the ears, and buds in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import HEADWEAR
from generator.plan.wear import NOTHING, OWN
from generator.worn.colours import Colour, drawn
from generator.worn.face import Face
from generator.worn.fit import CannotWear, Fit, Kind
from generator.worn.shapes import Part, assemble, ball, bar, closed_lattice, curve, limb, sweep, unit
from generator.worn.wrap import smoothed, step

PLASTIC: dict[Colour, float] = {
    (0.07, 0.07, 0.08): 6, (0.88, 0.88, 0.87): 3, (0.62, 0.63, 0.65): 2, (0.74, 0.69, 0.60): 1,
    (0.14, 0.19, 0.32): 1, (0.60, 0.10, 0.12): 1, (0.80, 0.60, 0.58): 0.7,
}  # fmt: skip
CUSHION: dict[Colour, float] = {(0.09, 0.09, 0.095): 6, (0.45, 0.44, 0.43): 1.5, (0.38, 0.25, 0.17): 1}

OVER_MM = {"cap": 17.0, "beanie": 14.0, "headscarf": 7.0, "headband": 6.0}
"""By how much what is on the head lifts a band; over other hats none goes."""

OVER_HAIR_MM = 8.0
CHIN = 152


@dataclass(frozen=True)
class _Cup:
    """half_z, half_y: of the oval, mm. pad: thickness of the cushion. deep: of the housing."""

    half_z: float
    half_y: float
    pad: float
    deep: float
    on_ear: bool


_CUPS = {
    "over-ear": _Cup(36.0, 45.0, 14.0, 18.0, on_ear=False),
    "on-ear": _Cup(29.0, 30.0, 11.0, 12.0, on_ear=True),
}


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`."""
    face = Face.of(fit)
    if style == "earbuds":
        return face.back(assemble(_buds(face, rng)))
    hat, hair = fit.others.get("headwear", NOTHING), fit.others.get("hair", OWN)
    if hat != NOTHING and hat not in OVER_MM:
        raise CannotWear(f"no band goes over headwear of style {hat}")
    over = OVER_MM.get(hat, 0.0) + (OVER_HAIR_MM if hair not in (OWN, NOTHING) and hat == NOTHING else 0.0)
    cup, colour = _CUPS[style], drawn(PLASTIC, rng)
    accent = drawn(PLASTIC, rng) if rng.random() < 0.35 else colour
    soft = drawn(CUSHION, rng)
    gloss = float(rng.choice([0.15, 0.4]))
    shell_of = Material("headphones", colour, label=HEADWEAR, gloss=gloss)
    cloth = Material("cushions", soft, label=HEADWEAR, gloss=0.1)
    parts: list[Part] = []
    ends = {}
    for side in (-1, 1):
        made, ends[side] = _cup(face, side, cup)
        parts.append(Part(made[0], soft, cloth))
        parts.append(Part(made[1], colour, shell_of))
        parts.append(Part(made[2], accent, shell_of))
    parts += _band(face, ends, over, colour, soft, shell_of, cloth, thin=style == "on-ear")
    return face.back(assemble(parts))


def _cup(face: Face, side: int, cup: _Cup) -> tuple[list, np.ndarray]:
    """Cushion, housing and its plate, and where the band meets it."""
    skull, ear, size = face.sides[side], face.sides[side].ear, face.scale
    middle = np.array([0.5 * (ear.top + ear.bottom), 0.5 * (ear.front + ear.back) + 1.0])
    turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    oval = np.stack([cup.half_y * np.sin(turn), cup.half_z * np.cos(turn)], axis=1) * size
    inside = middle + oval[:, None] * np.linspace(0.1, 0.75, 6)[:, None]
    outermost = skull.at(inside[..., 0], inside[..., 1], ears=True)
    around = skull.at(middle[0] + 0.85 * oval[:, 0], middle[1] + 0.85 * oval[:, 1])
    if (around <= 20).any():
        raise CannotWear("the head has no side for a cup to lie on")
    around = smoothed(around[None], (0, 2.0), around=True)[0]
    if cup.on_ear:
        seat = np.full(32, max(float(np.percentile(outermost, 70)) - 2.0, float(np.median(around))))
        plate = float(seat.max()) + cup.pad
    else:
        seat = around - 1.0
        plate = max(float(np.median(around)) + cup.pad, float(np.percentile(outermost, 90)) + 2.0)
    seat = np.minimum(seat, plate - 5.0)

    def ring(share: float, reach: np.ndarray | float) -> np.ndarray:
        x = np.broadcast_to(np.asarray(reach, dtype=np.float64), turn.shape)
        return np.stack([side * x, middle[0] + share * oval[:, 0], middle[1] + share * oval[:, 1]], axis=1)

    mid = 0.5 * (seat + plate)
    cushion = [
        ring(0.62, plate), ring(0.62, mid), ring(0.68, seat + 1.5), ring(0.80, seat), ring(0.92, seat + 1.5),
        ring(1.0, mid), ring(0.97, plate),
    ]  # fmt: skip
    deep = cup.deep * size
    housing = [
        ring(0.5, plate - 1), ring(0.98, plate - 0.5), ring(1.0, plate + 2), ring(0.99, plate + 0.35 * deep),
        ring(0.90, plate + 0.75 * deep), ring(0.74, plate + 0.95 * deep), ring(0.3, plate + deep),
    ]  # fmt: skip
    disc = [
        ring(0.60, plate + 0.90 * deep), ring(0.60, plate + deep + 1.0), ring(0.54, plate + deep + 2.0),
        ring(0.1, plate + deep + 2.0),
    ]  # fmt: skip
    meets = np.array([side * (plate + 0.45 * deep), middle[0] + 0.97 * cup.half_y * size, middle[1]])
    shapes = [closed_lattice(np.stack(cushion), along=True), closed_lattice(np.stack(housing))]
    return [*shapes, closed_lattice(np.stack(disc))], meets


def _band(
    face: Face,
    ends: dict[int, np.ndarray],
    over: float,
    colour: Colour,
    soft: Colour,
    plastic: Material,
    cloth: Material,
    *,
    thin: bool,
) -> list[Part]:
    """From cup to cup over the crown."""
    size = face.scale
    low, far = 0.5 * (ends[-1] + ends[1]), 0.5 * (ends[1][0] - ends[-1][0])
    turn = np.linspace(-np.pi / 2, np.pi / 2, 49)
    towards = np.stack([np.sin(turn), np.cos(turn), np.zeros(49)], axis=1)
    wide = 0.5 * (16 if thin else 26) * size
    centre = low
    places = [centre + np.array([0, 0, z]) for z in (-wide, 0.0, wide)]
    reach = np.fmax.reduce([face.outermost(place, towards) for place in places])
    top = reach[np.abs(turn) < 0.3]
    if not np.isfinite(top).all():
        raise CannotWear("the head has no crown for a band to lie on")
    free = np.nan_to_num(reach, nan=0.0) + (5.0 if thin else 8.0) + over
    free[np.abs(turn) > 1.35] = 0.0
    tall = float(top.max()) + (5.0 if thin else 8.0) + over
    arch = 1 / ((np.abs(np.sin(turn)) / far) ** 2.3 + (np.abs(np.cos(turn)) / tall) ** 2.3) ** (1 / 2.3)
    distance = smoothed(np.maximum(arch, free)[None], (0, 1.5))[0]
    distance[[0, -1]] = far
    path = centre + distance[:, None] * towards
    path = np.vstack([ends[-1] - [0, 10 * size, 0], path, ends[1] - [0, 10 * size, 0]])
    share = np.linspace(-1, 1, len(path))
    thick = 3.6 + (2.0 if thin else 4.0) * step((0.75 - np.abs(share)) / 0.2)
    across = (9 + (7 if thin else 17) * step((0.8 - np.abs(share)) / 0.3)) * size
    profile = bar(1.0, 1.0, 0.6) * np.stack([thick, across], axis=-1)[:, None]
    ahead = np.array([0.0, 0.0, 1.0])
    parts = [Part(sweep(path, profile, ahead), colour, plastic)]
    if not thin:
        some = np.abs(share) < 0.42
        inward = path[some] - unit(path[some] - centre) * 5.0
        ends_of = np.sin(np.pi * np.linspace(0.06, 0.94, int(some.sum()))) ** 0.4
        pad = bar(1.0, 1.0, 0.8) * np.stack([7.0 * ends_of, 0.88 * across[some]], axis=-1)[:, None]
        parts.append(Part(sweep(inward, pad, ahead), soft, cloth))
    return parts


def _buds(face: Face, rng: np.random.Generator) -> list[Part]:
    """A bud in each ear, with a stem or on a cable."""
    colour = drawn({(0.93, 0.93, 0.92): 5, (0.06, 0.06, 0.07): 4, (0.55, 0.56, 0.60): 1}, rng)
    wired = bool(rng.random() < 0.35)
    plastic = Material("earbuds", colour, label=HEADWEAR, gloss=0.5)
    parts: list[Part] = []
    size = face.scale
    (chin,) = face.at(CHIN)
    for side in (-1, 1):
        skull, ear = face.sides[side], face.sides[side].ear
        if not ear.found:
            raise CannotWear("no ear is found for a bud to sit in")
        # Where the ear is hollow, in its front half.
        height = ear.bottom + np.linspace(0.38, 0.62, 5) * (ear.top - ear.bottom)
        depth = ear.back + np.linspace(0.45, 0.85, 6) * (ear.front - ear.back)
        y, z = (grid.ravel() for grid in np.meshgrid(height, depth))
        hollow = skull.at(y, z, ears=True)
        low = int(hollow.argmin())
        place = np.array([side * (hollow[low] + 3.0), y[low], z[low]])
        parts.append(Part(ball(place, np.array([8.0, 8.5, 8.5]) * size, None, 14), colour, plastic))
        end = place + np.array([side * 3.0, -31.0 * size, 7.0 * size])
        if wired:
            end = place + np.array([side * 2.0, -15.0 * size, 3.0 * size])
            meet = np.array([0.0, chin[1] - 95 * size, chin[2] - 14 * size])
            side_of = np.array([side * 62.0 * size, chin[1] - 20 * size, place[2] + 22 * size])
            parts.append(Part(limb(curve(np.stack([end, side_of, meet]), 20), 1.1, 6), colour, plastic))
        from_bud = place + np.array([side * 4.0, 0, 1.0])
        stem = curve(np.stack([from_bud, 0.5 * (place + end) + [side * 2, 0, 1], end]), 6)
        parts.append(Part(limb(stem, 3.1 * size, 10), colour, plastic))
    return parts


KIND = Kind(make, minds=("headwear", "hair"))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Caps, beanies, hats with a brim, hard hats and headbands."""

from __future__ import annotations

import numpy as np

from generator.heads.mesh import Material
from generator.labels import HEADWEAR
from generator.worn.colours import CLOTH, Colour, drawn, luminance
from generator.worn.crown import Crown, crown_of
from generator.worn.face import Face
from generator.worn.shapes import Part, Shape, ball, closed_lattice, shell
from generator.worn.wrap import smoothed, step

HELMETS: dict[Colour, float] = {
    (0.93, 0.75, 0.10): 4, (0.93, 0.93, 0.91): 3, (0.90, 0.42, 0.08): 2, (0.12, 0.30, 0.62): 2,
    (0.72, 0.10, 0.10): 1, (0.16, 0.45, 0.22): 1,
}  # fmt: skip
FELT: dict[Colour, float] = {
    (0.10, 0.10, 0.11): 3, (0.33, 0.24, 0.17): 3, (0.45, 0.44, 0.43): 2, (0.72, 0.64, 0.50): 2,
    (0.14, 0.17, 0.25): 1, (0.35, 0.12, 0.13): 0.7,
}  # fmt: skip
STRAW: dict[Colour, float] = {(0.85, 0.74, 0.52): 3, (0.91, 0.86, 0.74): 2, (0.60, 0.45, 0.28): 1}


def cap(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """A baseball cap of six panels, with a peak and a button."""
    crown = crown_of(face, "cap", 72, over)
    rows = np.concatenate([[0, 0.03], np.linspace(0.08, 0.97, 15)])
    front = np.cos(crown.turns / 2) ** 6
    distance = smoothed(crown.distances(rows), (1.0, 1.5), around=True) + 2.2
    distance += 9 * face.scale * front * np.sin(np.pi * np.minimum(rows * 1.25, 1))[:, None] ** 1.5
    distance += 4.5 * face.scale * np.sin(np.pi * rows / 2)[:, None]
    seam = np.arange(72) % 12 == 0
    distance -= 0.7 * seam * (rows < 0.93)[:, None]
    colour = drawn(CLOTH, rng)
    panels = drawn(CLOTH, rng) if rng.random() < 0.25 else colour
    peak_colour = drawn(CLOTH, rng) if rng.random() < 0.3 else colour
    cloth = Material("cap", colour, label=HEADWEAR, gloss=0.05)
    in_front = (front > 0.42)[None, :, None] & (rows < 2)[:, None, None]
    colours = np.where(in_front, np.array(colour), np.array(panels)) * (1 - 0.28 * seam[None, :, None])
    colours = colours * (1 - 0.15 * ((rows > 0.02) & (rows < 0.05)))[:, None, None]
    outer = crown.at(rows, distance)
    parts = [_dome(crown, outer, colours, 1.6, cloth)]
    top = outer[-1].mean(axis=0)
    parts.append(Part(ball(top, np.array([6.0, 2.8, 6.0]) * 1.0, None, 10), peak_colour, cloth))
    parts.append(_peak(crown, outer, face.scale, 72.0, 0.36, peak_colour, cloth, rng))
    return parts


def hard_hat(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """A smooth shell with a ridge, a small brim and a short peak."""
    crown = crown_of(face, "hard-hat", 72, over)
    rows = np.concatenate([[0, 0.04], np.linspace(0.1, 0.98, 15)])
    distance = smoothed(crown.distances(rows), (2.0, 4.0), around=True) + 11
    distance += 9 * face.scale * np.sin(np.pi * rows / 2)[:, None]
    across = np.sin(crown.turns) * np.cos(crown.lifts(rows)) * distance
    distance += 3.5 * np.exp(-((across / 9) ** 2)) * step(rows * 4)[:, None]
    colour = drawn(HELMETS, rng)
    plastic = Material("hard hat", colour, label=HEADWEAR, gloss=0.55)
    outer = crown.at(rows, distance)
    brim = outer[:2].copy()
    out = brim - crown.centre
    out[..., 1] = 0
    width = 9 + 30 * np.maximum(np.cos(crown.turns), 0) ** 2
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    edge = brim[0] + out[0] * width[:, None] - np.array([0, 3.0, 0])
    sheet = np.stack([edge, 0.5 * (edge + brim[0]) + [0, 0.8, 0], brim[0] + [0, 1.0, 0]])
    below = sheet - np.array([0, 2.4, 0])
    strip = Part(shell(sheet, below, around=True), np.array(colour) * 0.95, plastic)
    return [_dome(crown, outer, np.array(colour), 2.5, plastic), strip]


def beanie(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """A knitted hat with a turned-up cuff, over the tops of the ears."""
    low = float(rng.uniform(-6, 6))
    crown = crown_of(face, "beanie", 96, over, (float(rng.uniform(-0.15, 0.15)), low, low))
    cuff = float(rng.uniform(0.30, 0.38)) if rng.random() < 0.8 else 0.0
    rows = np.concatenate([np.linspace(0, 0.28, 5), [max(cuff, 0.30), max(cuff, 0.30) + 0.004]])
    rows = np.concatenate([rows, np.linspace(rows[-1] + 0.06, 0.975, 11)])
    slouch = float(rng.uniform(6, 24)) * face.scale
    distance = smoothed(crown.distances(rows), (1.2, 3.0), around=True) + 3.0
    distance += slouch * (step((rows - 0.35) / 0.65) ** 1.2)[:, None]
    distance += np.where(rows <= cuff, 3.2, 0.0)[:, None]
    ribs = np.arange(96) % 2
    depth = np.where(rows < 0.9, 1.0, 0.3)[:, None]
    distance += depth * ribs
    colour, other = drawn(CLOTH, rng), drawn(CLOTH, rng)
    wool = Material("beanie", colour, label=HEADWEAR)
    base = np.broadcast_to(np.array(colour), (len(rows), 96, 3)).copy()
    pattern = str(rng.choice(["plain", "plain", "plain", "stripes", "cuff"]))
    if pattern == "stripes":
        base[((rows * 9).astype(int) % 2 == 1) & (rows > cuff)] = other
    if pattern == "cuff" and cuff:
        base[rows <= cuff] = other
    base *= 1 - (0.22 if luminance(colour) > 0.2 else 0.35) * (1 - ribs)[None, :, None]
    outer = crown.at(rows, distance)
    parts = [_dome(crown, outer, base, 3.0, wool)]
    if rng.random() < 0.35:
        parts.append(_pompom(outer[-1].mean(axis=0), 24 * face.scale, other, wool, rng))
    return parts


def brimmed(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """A felt or straw hat with a ribbon and a brim."""
    straw = bool(rng.random() < 0.4)
    crown = crown_of(face, "brimmed", 72, over)
    rows = np.linspace(0, 1, 24)[:-1]
    inner = crown.distances(rows)
    points = crown.at(rows, inner)
    level = np.hypot(points[..., 0], points[..., 2] - crown.centre[2])
    widest = smoothed(level.max(axis=0, keepdims=True), (0, 3.0), around=True)[0] + 3.0
    rim = crown.at(rows[:1], inner[:1])[0, :, 1]
    top = points[..., 1].max() + float(rng.uniform(3, 14)) * face.scale
    share = np.concatenate([[0, 0.02, 0.10, 0.22, 0.225], np.linspace(0.3, 0.94, 7)])
    high = rim + share[:, None] * (top - rim)
    inside = np.stack(
        [np.interp(high[:, k], points[:, k, 1], level[:, k]) for k in range(72)], axis=1
    )  # of the head at these heights
    wide = np.maximum(widest * (1 - 0.21 * share**2.2)[:, None], inside + 2.0)
    wide = smoothed(wide, (0.7, 1.5), around=True)
    ring = np.stack(
        [
            np.sin(crown.turns) * wide,
            high,
            crown.centre[2] + np.cos(crown.turns) * wide,
        ],
        axis=-1,
    )
    # Over the edge and in to the top, which is dented along its middle.
    lids = []
    for inwards, up in ((0.95, 0.975), (0.86, 1.0), (0.6, 1.005), (0.25, 1.005)):
        lid = ring[-1].copy()
        lid[:, [0, 2]] = (lid[:, [0, 2]] - [0, crown.centre[2]]) * inwards + [0, crown.centre[2]]
        lid[:, 1] = rim.mean() + up * (top - rim.mean())
        if not straw:
            lid[:, 1] -= 7.0 * np.exp(-((lid[:, 0] / 22) ** 2)) * (inwards < 0.95)
        lids.append(lid)
    outer = np.concatenate([ring, np.stack(lids)])
    colour = drawn(STRAW if straw else FELT, rng)
    ribbon = drawn(FELT, rng)
    felt = Material("hat", colour, label=HEADWEAR, gloss=0.03)
    colours = np.broadcast_to(np.array(colour), outer.shape).copy()
    banded = np.concatenate([(share >= 0.02) & (share <= 0.22), np.zeros(4, dtype=bool)])
    colours[banded] = ribbon
    if straw:
        colours[::2] *= 0.92
    parts = [_dome(crown, outer, colours, 2.0, felt)]
    width = float(rng.uniform(48, 72)) * face.scale
    bend = float(rng.uniform(-4, 12)) if not straw else float(rng.uniform(-16, 2))
    steps = np.array([1.0, 0.66, 0.33, 0.0])[:, None]
    out = np.stack([np.sin(crown.turns), 0 * crown.turns, np.cos(crown.turns)], axis=-1)
    sheet = outer[0] + steps[..., None] * width * out
    sheet[..., 1] += steps**2 * (
        bend * np.cos(2 * (crown.turns - np.pi / 2)) - 6 * np.abs(np.cos(crown.turns))
    )
    shade = np.array(colour) * (np.array([0.93, 1.0, 0.94, 1.0])[:, None, None] if straw else 0.97)
    paint = np.broadcast_to(shade, sheet.shape)
    both = np.concatenate([paint, 0.85 * paint[::-1]]).reshape(-1, 3)
    parts.append(Part(shell(sheet, sheet - np.array([0, 2.2, 0]), around=True), both, felt))
    return parts


def headband(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """A band about the forehead and behind, over the tops of the ears."""
    crown = crown_of(face, "headband", 72, over, (float(rng.uniform(-0.1, 0.1)), 0.0, 0.0))
    wide = float(rng.uniform(38, 62)) * face.scale
    share = np.linspace(0, 1, 7)
    # As an angle of the front, where it is seen.
    rows = share * wide / crown.distances(np.zeros(1))[0, 0] / (np.pi / 2 - crown.rim[0])
    distance = smoothed(crown.distances(rows), (0.8, 2.0), around=True) + 1.6
    distance += 1.8 * np.sin(np.pi * share)[:, None] ** 0.5 + 0.7 * (np.arange(72) % 2)
    outer = crown.at(rows, distance)
    colour, other = drawn(CLOTH, rng), drawn(CLOTH, rng)
    stripes = (share > 0.35) & (share < 0.65) & (rng.random() < 0.35)
    paint = np.where(stripes[:, None, None], np.array(other), np.array(colour))
    paint = np.broadcast_to(paint, outer.shape) * (1 - 0.15 * (np.arange(72) % 2))[:, None]
    inner = crown.at(rows, distance - 2.6)
    both = np.concatenate([paint, 0.8 * paint[::-1]]).reshape(-1, 3)
    return [Part(shell(outer, inner, around=True), both, Material("headband", colour, label=HEADWEAR))]


def _dome(crown: Crown, outer: np.ndarray, colours: np.ndarray, thick: float, material: Material) -> Part:
    """Rows of points [M, N, 3] from the rim up as a closed body; its inside is seen near the rim alone."""
    middle = np.array([0.0, outer[0, :, 1].mean(), crown.centre[2]])
    out = outer - middle
    inner = outer - thick * out / np.linalg.norm(out, axis=-1, keepdims=True)
    some = [8, 4, 0]
    rings = np.concatenate([inner[some], outer])
    paint = np.broadcast_to(colours, outer.shape)
    every = np.concatenate([0.6 * paint[some], paint]).reshape(-1, 3)
    ends = np.stack([every[: outer.shape[1]].mean(axis=0), paint[-1].mean(axis=0)])
    return Part(closed_lattice(rings), np.vstack([every, ends]), material)


def _peak(
    crown: Crown,
    outer: np.ndarray,
    scale: float,
    length: float,
    wide: float,
    colour: Colour,
    material: Material,
    rng: np.random.Generator,
) -> Part:
    """A curved sheet before the front of the rim; wide: share of half the way round that it takes."""
    share = np.linspace(-1, 1, 25)
    base = np.stack(
        [np.interp(share * wide * np.pi, *_around(crown.turns, outer[1, :, axis])) for axis in range(3)],
        axis=-1,
    )
    curl = float(rng.uniform(4, 15)) * scale
    long = length * scale * (1 - np.abs(share) ** 2.6) ** 0.8
    steps = np.linspace(0, 1, 7)[:, None]
    sheet = np.repeat(base[None], 7, axis=0)
    sheet[..., 2] += steps * long - 3.0
    side = base[:, 0] / np.abs(base[:, 0]).max()
    sheet[..., 1] += -0.20 * steps * long - curl * side**2 * np.sqrt(steps) + 2.0
    sheet[..., 0] *= 1 - 0.06 * steps
    lines = 1 - 0.10 * (np.arange(7) % 2)[:, None, None]
    paint = np.broadcast_to(np.array(colour) * lines, sheet.shape)
    rings = np.concatenate([paint, 0.7 * paint[::-1]]).swapaxes(0, 1).reshape(-1, 3)
    return Part(shell(sheet, sheet - np.array([0, 2.4, 0])), rings, material)


def _around(turns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles from -pi to pi and their values, in order."""
    signed = np.where(turns > np.pi, turns - 2 * np.pi, turns)
    order = np.argsort(signed)
    return signed[order], values[order]


def _pompom(
    place: np.ndarray, radius: float, colour: Colour, material: Material, rng: np.random.Generator
) -> Part:
    shape = ball(np.zeros(3), np.full(3, radius), None, 20)
    uneven = 1 + 0.10 * rng.standard_normal(len(shape.vertices))
    centre = place + np.array([0, 0.75 * radius, 0])
    shade = np.array(colour) * np.clip(uneven, 0.75, 1.2)[:, None]
    return Part(Shape(shape.vertices * uneven[:, None] + centre, shape.triangles), shade, material)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair grows: from roots on a skull, step by step, as it is combed and as it falls."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from generator.worn.cuts import Cut
from generator.worn.skull import Skull
from generator.worn.strips import resample

STEPS, FEW_STEPS = 18, 5
"""Of hair, and of stubble."""

BEND_MM = 25.0
"""Hair bends to where it is drawn within about this length."""
GOLDEN = np.pi * (3 - np.sqrt(5))
DOWN = np.array([0.0, -1.0, 0.0])
CROWN_DEG = (180.0, 62.0)
"""Azimuth and elevation of the whorl."""


class Level(NamedTuple):
    """Heights in frame U, mm, at which hair is cut."""

    brows: float
    chin: float


class Locks(NamedTuple):
    """paths: float64 [N, K, 3], mm. layer: 0 for hair next to the skin to 1 for the outermost, [N]."""

    paths: np.ndarray
    layer: np.ndarray


def grow(skull: Skull, cut: Cut, level: Level, rng: np.random.Generator) -> Locks:
    """Locks of a cut on a skull."""
    turn, rise = _roots(skull, cut.locks, rng)
    count = len(turn)
    layer = rng.uniform(0, 1, count)
    thick = cut.flat + (1 - cut.flat) * smooth(0, 40, np.degrees(rise))
    height = skull.scale * (1.0 + (cut.layer * thick - 1.0) * (0.2 + 0.8 * layer))
    length = skull.scale * _lengths(skull, cut, turn, rise) * rng.uniform(0.82, 1.1, count)
    stray = cut.stray * rng.normal(size=(count, 3)) + 0.6 * cut.stray * _clumps(turn, rise, rng)
    place = skull.point(turn, rise, 0.3)
    roots = place
    comb = COMBS[cut.comb]
    over = np.degrees(rise - skull.hairline(turn))
    ahead = (smooth(65, 35, np.degrees(np.abs(turn))) * smooth(34, 6, over))[:, None]
    sweep = np.array([cut.sweep, 0.5 * abs(cut.sweep), 0.0])
    fringe = _fringe(skull, cut, turn, rise)
    bottom = np.where(fringe, level.brows + cut.fringe * skull.scale, level.chin + cut.level * skull.scale)
    bottom = np.nan_to_num(bottom + skull.scale * rng.normal(0, 5, count), nan=-np.inf)
    edge = np.radians(rng.normal(-2.0, 3.0, count))
    steps = STEPS if cut.points > 3 else FEW_STEPS
    paths, direction = [place], np.zeros_like(place)
    pace = (length / steps)[:, None]
    keep = np.exp(-pace / (BEND_MM * skull.scale))
    for step in range(1, steps + 1):
        share = step / steps
        normal = skull.normal(place)
        wish = comb(skull, cut, roots, place, normal) + ahead * sweep
        wish = np.where(fringe[:, None], _forwards(normal), wish)
        wish = wish - (wish * normal).sum(1, keepdims=True) * normal
        stand = cut.stand * (1 + ahead * abs(cut.sweep)) * (1 - share) ** (9 if cut.hangs else 2)
        # What hangs free is not combed.
        lies = smooth(-5, 28, np.degrees(skull.angles(place)[1]))[:, None] if cut.hangs else 1.0
        wish = cut.pull * lies * wish * (1 - share) ** cut.relax + cut.fall * DOWN * (0.4 + 1.6 * share)
        if cut.hangs:
            wish = wish + 0.16 * cut.fall * (1 - lies) * _inwards(skull, place)
        wish = _units(wish + stand * normal + 0.5 * stray)
        direction = _units(keep * direction + (1 - keep) * wish) if step > 1 else wish
        place = place + direction * pace
        place = _beside_face(skull, cut, place, level, fringe)
        if not np.isfinite(cut.fringe):
            place = _off_forehead(skull, place, edge)
        place = _pressed(skull, cut, place, height[:, None] * np.minimum(1, pace * step / (30 * skull.scale)))
        paths.append(place)
    whole = np.stack(paths, axis=1)
    whole = _curled(skull, cut, whole, rng)
    short = _until(whole, bottom)
    kept = short > 4 * min(1.0, cut.top / 20)
    bias = 1.0 if cut.curl[0] > 0 else 1.3
    return Locks(resample(whole[kept], short[kept], cut.points, bias), layer[kept])


def _roots(skull: Skull, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth and elevation of roots, evenly over what is above the hairline."""
    everywhere = int(count / 0.62)
    number = np.arange(everywhere) + 0.5
    rise = np.arcsin(1 - 2 * number / everywhere)
    turn = (number * GOLDEN + rng.uniform(0, 6)) % (2 * np.pi) - np.pi
    spread = 1.2 / np.sqrt(everywhere)
    rise = np.clip(rise + rng.normal(0, spread, everywhere), -1.5, 1.57)
    turn = turn + rng.normal(0, spread, everywhere) / np.maximum(np.cos(rise), 0.1)
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    above = rise > skull.hairline(turn) + np.radians(1.5) * rng.normal(0.4, 0.7, everywhere)
    return turn[above], rise[above]


def _lengths(skull: Skull, cut: Cut, turn: np.ndarray, rise: np.ndarray) -> np.ndarray:
    around, high = np.degrees(np.abs(turn)), np.degrees(rise)
    top, behind = smooth(14, 42, high), smooth(105, 145, around)
    ahead = smooth(66, 44, around) * smooth(75, 50, high)
    length = top * cut.top + (1 - top) * ((1 - behind) * cut.side + behind * cut.back)
    length = ahead * cut.front + (1 - ahead) * length
    over = np.degrees(rise - skull.hairline(turn))
    edge = cut.taper + (1 - cut.taper) * smooth(0, 22, over)
    return length * np.where(ahead > 0.5, np.maximum(edge, 0.8), edge)


def _clumps(turn: np.ndarray, rise: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noise that neighbours share, [N, 3]."""
    waves = rng.normal(size=(12, 3)) * 4.0
    phase, weight = rng.uniform(0, 6.28, 12), rng.normal(size=(12, 3))
    flat = np.cos(rise)
    unit = np.stack([np.sin(turn) * flat, np.sin(rise), np.cos(turn) * flat], axis=1)
    return np.sin(unit @ waves.T + phase) @ weight / 3.5


def _fringe(skull: Skull, cut: Cut, turn: np.ndarray, rise: np.ndarray) -> np.ndarray:
    if not np.isfinite(cut.fringe):
        return np.zeros(len(turn), dtype=bool)
    return (np.abs(np.degrees(turn)) < 58) & (np.degrees(rise) < 68)


def _beside_face(skull: Skull, cut: Cut, place: np.ndarray, level: Level, fringe: np.ndarray) -> np.ndarray:
    """Hair that hangs is swept off the face."""
    turn, rise = skull.angles(place)
    low = smooth(level.brows + 40 * skull.scale, level.brows, place[:, 1])
    limit = np.radians(cut.open) * low
    short = np.abs(turn) < limit
    swept = np.where(short & ~fringe, np.sign(turn) * (0.4 * np.abs(turn) + 0.6 * limit), turn)
    away = np.linalg.norm(place - skull.centre, axis=1)
    flat = np.cos(rise)
    moved = np.stack([np.sin(swept) * flat, np.sin(rise), np.cos(swept) * flat], axis=1)
    return np.where((swept != turn)[:, None], skull.centre + away[:, None] * moved, place)


def _off_forehead(skull: Skull, place: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Hair without a fringe stays above the hairline."""
    turn, rise = skull.angles(place)
    line = skull.hairline(turn) + edge
    below = smooth(58, 44, np.degrees(np.abs(turn))) * np.maximum(line - rise, 0)
    away = np.linalg.norm(place - skull.centre, axis=1)
    raised = rise + below
    flat = np.cos(raised)
    unit = np.stack([np.sin(turn) * flat, np.sin(raised), np.cos(turn) * flat], axis=1)
    return np.where((below > 0)[:, None], skull.centre + away[:, None] * unit, place)


def _pressed(skull: Skull, cut: Cut, place: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Hair neither enters the head nor flies off."""
    away = place - skull.centre
    distance = np.linalg.norm(away, axis=1)
    height = height[:, 0]
    ground = skull.radius(place, ears=True) + height
    high = skull.radius(place) + height
    _, rise = skull.angles(place)
    loose = distance > high
    hug = cut.hug * smooth(-25, 10, np.degrees(rise))
    wanted = np.where(loose, high + (distance - high) * (1 - hug), distance)
    wanted = np.maximum(wanted, ground)
    return skull.centre + away * (wanted / distance)[:, None]


def _curled(skull: Skull, cut: Cut, paths: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    radius, usual = cut.curl
    if radius <= 0:
        return paths
    # Finer than it grew: a turn needs points.
    fine = resample(paths, np.full(len(paths), np.inf), 3 * STEPS)
    along = np.gradient(fine, axis=1)
    steps = np.linalg.norm(along, axis=2, keepdims=True)
    along /= np.maximum(steps, 1e-9)
    side = np.cross(along, np.broadcast_to(np.array([0.3, -1.0, 0.2]), along.shape))
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-9)
    up = np.cross(side, along)
    arc = np.cumsum(steps[..., 0], axis=1)
    wave = usual * rng.uniform(0.75, 1.3, (len(paths), 1)) * skull.scale
    phase = arc / wave * 2 * np.pi + rng.uniform(0, 2 * np.pi, (len(paths), 1))
    grown = radius * skull.scale * np.minimum(arc / (1.5 * wave), 1)
    return fine + grown[..., None] * (np.cos(phase)[..., None] * side + np.sin(phase)[..., None] * up)


def _until(paths: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    """Length of each path until it first is below its bottom, mm."""
    steps = np.linalg.norm(np.diff(paths, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(paths), 1)), np.cumsum(steps, axis=1)], axis=1)
    below = paths[:, :, 1] < bottom[:, None]
    first = np.where(below.any(axis=1), below.argmax(axis=1), paths.shape[1] - 1)
    return along[np.arange(len(paths)), first]


def smooth(low: float, high: float, value: np.ndarray) -> np.ndarray:
    """0 at low, 1 at high, smooth between."""
    share = np.clip((value - low) / (high - low), 0, 1)
    return share * share * (3 - 2 * share)


def _forwards(normal: np.ndarray) -> np.ndarray:
    return np.broadcast_to([0.0, -0.35, 1.0], normal.shape) - 0.15 * normal * [1, 0, 0]


def _inwards(skull: Skull, place: np.ndarray) -> np.ndarray:
    """Towards the axis of the neck."""
    return _units((skull.centre - place) * [1.0, 0.0, 1.0])


Comb = Callable[[Skull, Cut, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def _whorl(skull: Skull, cut: Cut, roots: np.ndarray, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    turn, rise = np.radians(CROWN_DEG)
    away = place - skull.point(np.array([turn]), np.array([rise]))
    spin = np.cross(normal, away)
    return _units(away + 0.35 * spin)


def _part(skull: Skull, cut: Cut, roots: np.ndarray, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    beside = roots[:, 0] - skull.centre[0] - cut.parting * skull.scale
    side = np.where(beside < 0, -1.0, 1.0)
    back = np.full(len(side), cut.backwards)
    away = np.stack([side, np.full(len(side), 0.0), back], axis=1)
    # Behind the crown there is no parting.
    behind = smooth(-15, -60, roots[:, 2] - skull.centre[2])[:, None]
    return (1 - behind) * away + behind * _whorl(skull, cut, roots, place, normal)


def _back(skull: Skull, cut: Cut, roots: np.ndarray, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    low = smooth(30, -20, place[:, 1] - skull.centre[1])[:, None]
    return np.broadcast_to([0.0, 0.05, -1.0], place.shape) + low * DOWN * 0.9


def _gather(skull: Skull, cut: Cut, roots: np.ndarray, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return _units(knot(skull, cut) - place)


COMBS: dict[str, Comb] = {"whorl": _whorl, "part": _part, "back": _back, "gather": _gather}
"""How hair is combed: (skull, cut, roots, places, normals there), each [N, 3] -> directions [N, 3]."""


def knot(skull: Skull, cut: Cut) -> np.ndarray:
    """Where hair is gathered behind, float64 [3]."""
    return skull.point(np.array([np.pi]), np.radians([cut.knot]), 4 * skull.scale)[0]


def _units(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)

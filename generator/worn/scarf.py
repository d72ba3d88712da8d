# SPDX-License-Identifier: GPL-3.0-or-later
"""A head scarf that leaves the oval of the face free and covers hair, ears and neck, with its folds."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from generator.heads.mesh import Material
from generator.labels import HEADWEAR
from generator.worn.colours import CLOTH, drawn
from generator.worn.face import FAR_MM, Face
from generator.worn.fit import CannotWear
from generator.worn.shapes import Part, curve, lattice
from generator.worn.wrap import Taut, smoothed, step

OVAL = (
    152, 377, 400, 378, 379, 365, 397, 288, 361, 323, 454, 356, 389, 251, 284, 332, 297, 338,
    10, 109, 67, 103, 54, 21, 162, 127, 234, 93, 132, 58, 172, 136, 150, 149, 176, 148,
)  # fmt: skip
"""Landmarks around the face, from the chin by image right."""

COLUMNS, ROWS = 64, 30
FREE_MM = 2.2

LOOSE = 0.58
"""From here to the hem it hangs."""


def scarf(face: Face, rng: np.random.Generator, over: float) -> list[Part]:
    """Rings of cloth from the face's oval over the head and the neck down to a hem."""
    oval = face.at(*OVAL)
    chin, top, left, right = oval[0], oval[18], oval[9], oval[27]
    size = face.scale
    middle = 0.5 * (left + right)
    # Within the landmarks, and under the chin.
    opening = curve(oval, COLUMNS, closed=True)
    inwards = opening - [middle[0], 0.5 * (chin[1] + top[1]), 0]
    opening[:, 0] -= 0.07 * inwards[:, 0]
    opening[:, 1] -= 0.05 * np.maximum(inwards[:, 1], 0)
    turn = np.arctan2(inwards[:, 0], -inwards[:, 1])  # 0 at the chin, pi at the forehead
    low = (1 + np.cos(turn)) / 2
    opening[:, 1] -= 7.0 * size * low**3
    opening[:, 2] -= 9.0 * size * low**3

    crown = float(face.outermost(np.array([0.0, 0.0, 10.0]), np.array([[0.0, 1.0, 0.0]]))[0])
    if not np.isfinite(crown):
        raise CannotWear("the head has no crown")
    throat = np.array([0.0, chin[1] - 22 * size, chin[2] - 48 * size])
    hem = _hem(turn, chin, size, float(rng.uniform(48, 62)))
    crest = np.stack(
        [
            78 * size * np.sin(turn) * (0.6 + 0.4 * np.sin(turn) ** 2),
            (1 - low) * crown + low * throat[1] - 30 * size * np.sin(turn) ** 2,
            (1 - low) * 2.0 + low * (throat[2] + 30 * size),
        ],
        axis=-1,
    )
    behind = np.stack(
        [
            70 * size * np.sin(turn),
            (1 - low) * 10.0 + low * (throat[1] - 14 * size) - 62 * size * np.sin(turn) ** 2,
            (1 - low) * -108.0 + low * (throat[2] + 30 * size) - 20 * size * np.sin(turn) ** 2,
        ],
        axis=-1,
    )
    nape = 0.5 * behind + 0.5 * hem
    nape[:, 2] = np.where(low < 0.5, np.maximum(nape[:, 2], -78 * size), nape[:, 2])
    knots = np.stack([opening, crest, behind, nape, hem])
    rough = PchipInterpolator([0, 0.34, 0.62, 0.80, 1.0], knots, axis=0)(np.linspace(0, 1, ROWS))
    loose = np.linspace(0, 1, ROWS)[:, None] > LOOSE
    centres = np.zeros_like(rough)
    centres[..., 1] = np.clip(rough[..., 1], chin[1] - 60 * size, 20 * size)
    centres[..., 2] = np.interp(centres[..., 1], [chin[1] - 30 * size, 0], [18.0 * size, 12.0])
    out = rough - centres
    length = np.linalg.norm(out, axis=-1)
    towards = out / length[..., None]
    surface = _surface(face, centres, towards)
    share = np.linspace(0, 1, ROWS)[:, None]
    distance = np.where(loose, np.maximum(length, np.fmin(surface, 1.12 * length)), surface)
    distance = np.where(np.isfinite(distance), distance, length)
    distance = _taut(face, centres, towards, distance, share, float(chin[1]), 0.5 * (left + right)[2])
    distance = smoothed(distance, (1.0, 1.2), around=True) + FREE_MM + over
    phase, waves = rng.random(3) * 2 * np.pi, rng.integers(5, 9)
    fold = np.sin(waves * turn + 5 * share + phase[0]) + 0.6 * np.sin(
        (waves + 4) * turn - 7 * share + phase[1]
    )
    strength = (0.9 + 3.6 * share**1.4) * (0.4 + 0.6 * np.sin(np.pi * np.minimum(share * 1.6, 1)))
    distance = distance + strength * (1.2 + fold) * np.minimum(share * 8, 1)
    outer = centres + distance[..., None] * towards
    inner = centres + (distance - 1.2)[..., None] * towards
    colour, other = drawn(CLOTH, rng, 0.03), drawn(CLOTH, rng)
    paint = np.broadcast_to(np.array(colour), outer.shape).copy()
    if rng.random() < 0.2:
        paint[(np.floor(share * 11 + 0 * turn) % 3 == 0)] = other
    paint *= (1 + 0.05 * np.clip(fold, -1.5, 1.5) * share)[..., None]
    # Its inside is seen at its ends alone.
    rings = np.concatenate([inner[[1, 0]], outer, inner[[-1, -2]]])
    both = np.concatenate([0.8 * paint[[1, 0]], paint, 0.8 * paint[[-1, -2]]]).reshape(-1, 3)
    body = lattice(rings[:, ::-1], around=True)
    both = both.reshape(rings.shape)[:, ::-1].reshape(-1, 3)
    return [Part(body, np.clip(both, 0, 1), Material("scarf", colour, label=HEADWEAR, gloss=0.08))]


def _hem(turn: np.ndarray, chin: np.ndarray, size: float, drop: float) -> np.ndarray:
    """Where the scarf ends, on the shoulders and the chest, float64 [N, 3]."""
    wide = np.stack([np.sin(turn) * 94, 0 * turn, np.cos(turn) * 82 - 12], axis=-1) * size
    wide[:, 1] = chin[1] - drop * size - 10 * size * (1 + np.cos(turn)) / 2
    return wide


def _surface(face: Face, centres: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How far the head reaches from each centre, float64 [M, N]; NaN where there is nothing."""
    origins = (centres + FAR_MM * towards).reshape(-1, 3)
    hits = face.cast(origins, -towards.reshape(-1, 3))
    return ((hits - centres.reshape(-1, 3)) * towards.reshape(-1, 3)).sum(axis=1).reshape(centres.shape[:2])


def _taut(
    face: Face,
    centres: np.ndarray,
    towards: np.ndarray,
    distance: np.ndarray,
    share: np.ndarray,
    chin: float,
    depth: float,
) -> np.ndarray:
    """Distances [M, N] that are nowhere within the hull of skull, hair and ears. depth: of the sides."""
    head = face.vertices
    brow = face.at(OVAL[18])[0, 1]
    kept = (head[:, 1] > chin + 18) & ((head[:, 2] < depth + 8) | (head[:, 1] > brow + 3))
    middle = np.array([0.0, 0.3 * brow, 5.0])
    hull = Taut(head[kept & (np.linalg.norm(head, axis=1) < 190)], middle)
    height = (centres + distance[..., None] * towards)[..., 1]
    upper = step(share / 0.14) * step((LOOSE - share) / 0.1) * step((height - chin) / 18)
    drawn_over = np.clip(hull.reach(towards, centres) + 1.5 - distance, 0, 60)
    return distance + upper * drawn_over

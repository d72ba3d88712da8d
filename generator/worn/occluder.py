# SPDX-License-Identifier: GPL-3.0-or-later
"""What is before a face: a hand, a phone, a mug, a microphone or a sheet of paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.heads.mesh import HeadMesh, Material
from generator.labels import OCCLUDER
from generator.worn.colours import ACETATE, CLOTH, drawn
from generator.worn.face import Face
from generator.worn.fit import Fit, Kind
from generator.worn.hand import hand
from generator.worn.shapes import Part, Shape, assemble, ball, bar, closed_lattice, lathe, shell, sweep

NOSE = (1, 4, 5)
"""Landmarks at its tip."""

BEFORE_MM = (18.0, 55.0)
"""Between the tip of the nose and what is nearest to it."""

AXES = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
"""Of a body of revolution that stands: its axis is up."""


def phone(rng: np.random.Generator) -> list[Part]:
    """A phone whose back is to the camera; its screen is black."""
    case = drawn({**CLOTH, **ACETATE}, rng)
    glossy = Material("phone", case, label=OCCLUDER, gloss=float(rng.choice([0.15, 0.5])))
    black = Material("screen", (0.02, 0.02, 0.025), label=OCCLUDER, gloss=0.85)
    width, height, deep = float(rng.uniform(69, 79)), float(rng.uniform(143, 166)), 9.0
    outline = _rounded(width, height, 11.0)
    levels = ((0.93, -0.5), (0.985, -0.42), (1.0, -0.2), (1.0, 0.2), (0.985, 0.42), (0.93, 0.5))
    rings = [np.column_stack([outline * share, np.full(len(outline), z * deep)]) for share, z in levels]
    parts = [Part(closed_lattice(np.stack(rings)), case, glossy)]
    screen = outline * [0.92, 0.96]
    flat = [np.column_stack([screen, np.full(len(screen), z)]) for z in (-4.4, -4.75)]
    parts.append(Part(closed_lattice(np.stack(flat)), black.base_color, black))
    # Cameras in a corner of the back.
    plate = _rounded(30.0, 32.0, 7.0, 6) + np.array([-width / 2 + 20.0, height / 2 - 21.0])
    raised = [np.column_stack([plate, np.full(len(plate), z)]) for z in (4.2, 5.8)]
    shade = np.clip(np.array(case) * 0.9 + 0.02, 0, 1)
    parts.append(Part(closed_lattice(np.stack(raised)), shade, glossy))
    for x, y in ((-7.0, 7.5), (-7.0, -7.5), (7.0, 0.0)):
        centre = np.array([-width / 2 + 20.0 + x, height / 2 - 21.0 + y, 5.6])
        glass = lathe(np.array([(5.6, 0), (5.6, 1.4), (4.6, 1.9), (0.2, 1.4)]), centre, np.eye(3), 16)
        parts.append(Part(glass, black.base_color, black))
    return _turned(parts, rng, 22, (-18, 18), 40)


def mug(rng: np.random.Generator) -> list[Part]:
    """A mug with its handle to one side."""
    colour, inside = drawn({**CLOTH, (0.92, 0.91, 0.88): 8}, rng), (0.90, 0.88, 0.85)
    ware = Material("mug", colour, label=OCCLUDER, gloss=0.6)
    radius, height = float(rng.uniform(38, 45)), float(rng.uniform(85, 105))
    half = height / 2
    outline = np.array(
        [
            (0.5, -half), (0.86 * radius, -half), (0.97 * radius, -half + 5), *((radius, y) for y in
            np.linspace(-half + 14, half - 3, 7)), (radius - 1.6, half), (radius - 3.6, half - 2),
            (radius - 4.5, half - 40), (radius - 5, -half + 9), (0.5, -half + 6),
        ]
    )  # fmt: skip
    body = lathe(outline, np.zeros(3), AXES, 36)
    paint = np.broadcast_to(np.array(colour), body.vertices.shape).copy()
    band, y = drawn(CLOTH, rng), body.vertices[:, 1]
    level = np.hypot(body.vertices[:, 0], body.vertices[:, 2])
    if rng.random() < 0.5:
        paint[(np.abs(y) < 0.25 * height) & (level > radius - 1)] = band
    paint[(level < radius - 3) & (y > -half + 3)] = inside
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 15)
    bow = np.stack([radius - 2 + 27 * np.cos(turn), 0.31 * height * np.sin(turn), 0 * turn], axis=1)
    handle = sweep(bow, bar(9.0, 13.0, 0.8)[:, ::-1], np.array([0.0, 0, 1.0]))
    spin = float(rng.choice([0.0, 180.0])) + float(rng.uniform(-50, 50))
    spun = graphics_rotation(rotation_from_angles(np.array([spin, 0, 0])))
    parts = [
        _placed(part, spun, np.zeros(3)) for part in (Part(body, paint, ware), Part(handle, colour, ware))
    ]
    return _turned(parts, rng, 0, (-15, 40), 15)


def microphone(rng: np.random.Generator) -> list[Part]:
    """A microphone held from below, its head before the mouth or the nose."""
    steel, grip = (0.45, 0.45, 0.46), drawn(ACETATE, rng)
    foam = rng.random() < 0.4
    colour = drawn(CLOTH, rng) if foam else steel
    grille = Material("grille", colour, label=OCCLUDER, gloss=0.0 if foam else 0.5)
    body = Material("microphone", grip, label=OCCLUDER, gloss=0.3)
    radius = 31.0 if foam else 25.0
    head = ball(np.zeros(3), np.array([radius, 1.12 * radius, radius]), AXES @ np.diag([1.0, 1, 1]), 26)
    checks = (np.arange(len(head.vertices)) + np.arange(len(head.vertices)) // 26) % 2
    shade = np.array(colour) * (1 - (0.12 if foam else 0.4) * checks)[:, None]
    outline = [
        (13.0, -190),
        (14.0, -187),
        (15.5, -90),
        (18, -42),
        (23, -22),
        (24.5, -14),
        (24.5, -8),
        (8, -4),
    ]
    parts = [
        Part(head, shade, grille),
        Part(lathe(np.array(outline), np.zeros(3), AXES, 24), grip, body),
    ]
    return _turned(parts, rng, 40, (5, 60), 40)


def paper(rng: np.random.Generator) -> list[Part]:
    """A sheet of paper, a little bent, with printed lines."""
    width, height = (210.0, 297.0) if rng.random() < 0.5 else (148.0, 210.0)
    white = float(rng.uniform(0.86, 0.95))
    sheet = Material("paper", (white, white, white * 0.985), label=OCCLUDER)
    rows, columns = 57, 21
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns) * width, np.linspace(-0.5, 0.5, rows) * height)
    bend = float(rng.uniform(250, 900)) * (1 if rng.random() < 0.5 else -1)
    front = np.stack([x, y, x**2 / (2 * bend) + 0.02 * y * np.sin(x / 60)], axis=-1)
    paint = np.broadcast_to(np.array(sheet.base_color), front.shape).copy()
    ends = rng.uniform(0.55, 0.95, rows)
    lines = (np.arange(rows) % 3 == 1) & (np.abs(np.arange(rows) - rows / 2) < 0.42 * rows)
    across = np.linspace(0, 1, columns)
    paint[lines[:, None] & (across > 0.1) & (across < ends[:, None])] *= float(rng.uniform(0.35, 0.75))
    back = np.broadcast_to(np.array(sheet.base_color), front.shape)
    both = np.concatenate([paint, back[::-1]]).swapaxes(0, 1).reshape(-1, 3)
    parts = [Part(shell(front, front - np.array([0, 0, 0.5])), both, sheet)]
    return _turned(parts, rng, 30, (-25, 25), 20)


STYLES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "hand": hand,
    "phone": phone,
    "mug": mug,
    "microphone": microphone,
    "paper": paper,
}


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`. It stands before the tip of the nose, in whatever direction."""
    face = Face.of(fit)
    nose = face.at(*NOSE)
    made = assemble(STYLES[style](rng))
    x, y = nose[:, :2].mean(axis=0)
    nearest = made.vertices[:, 2].min()
    before = nose[:, 2].max() + float(rng.uniform(*BEFORE_MM)) - nearest
    return face.back(replace(made, vertices=made.vertices + np.array([x, y, before])))


def _rounded(width: float, height: float, radius: float, count: int = 8) -> np.ndarray:
    """A rectangle with round corners, float64 [4 count, 2], counter-clockwise."""
    turn = np.linspace(0, np.pi / 2, count)
    corner = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    made = []
    for k in range(4):
        c, s = round(np.cos(k * np.pi / 2)), round(np.sin(k * np.pi / 2))
        at = np.array([(width / 2 - radius) * (1 if k in (0, 3) else -1),
                       (height / 2 - radius) * (1 if k in (0, 1) else -1)])  # fmt: skip
        made.append(corner @ np.array([[c, s], [-s, c]]) + at)
    return np.vstack(made)


def _turned(
    parts: list[Part],
    rng: np.random.Generator,
    yaw: float,
    pitch: tuple[float, float],
    roll: float,
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Part]:
    """Parts about their middle, turned at random: degrees at most, or from and to."""
    angles = np.array([rng.uniform(-yaw, yaw), rng.uniform(*pitch), rng.uniform(-roll, roll)])
    turn = graphics_rotation(rotation_from_angles(angles))
    return [_placed(part, turn, np.array(middle)) for part in parts]


def _placed(part: Part, turn: np.ndarray, middle: np.ndarray) -> Part:
    vertices = (part.shape.vertices - middle) @ turn.T
    return Part(Shape(vertices, part.shape.triangles), part.colors, part.material)


KIND = Kind(make)

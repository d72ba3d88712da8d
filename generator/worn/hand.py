# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand: palm, four fingers and a thumb of limbs that flow together, with nails and a wrist."""

from __future__ import annotations

import numpy as np

from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.heads.mesh import Material
from generator.labels import OCCLUDER
from generator.worn.blend import Cones, skin_of
from generator.worn.colours import CLOTH, SKIN, drawn
from generator.worn.shapes import Part, Shape, ball, limb

FINGERS = (
    # Knuckle x, y; lengths of its bones; radii at knuckle and tip.
    ((-28.0, 40.0), (43.0, 26.0, 21.0), (9.0, 6.6)),
    ((-9.0, 45.0), (48.0, 30.0, 22.0), (9.2, 6.8)),
    ((10.0, 42.0), (44.0, 28.0, 22.0), (8.7, 6.4)),
    ((28.0, 33.0), (34.0, 20.0, 19.0), (7.6, 5.6)),
)
"""Of a hand with its fingers up, its back to the viewer and the thumb at image left, mm about the palm."""

WRIST = np.array([0.0, -46.0, 0.0])
SOFT_MM = 2.6
STEP_MM = 5.15

FORWARD = np.array([0.0, 0.0, 1.0])


def hand(rng: np.random.Generator) -> list[Part]:
    """A hand about its palm in F, its back or its palm to the camera."""
    starts, ends, first, last, nails = [], [], [], [], []

    def of_wrist(x: float, y: float, z: float) -> np.ndarray:
        return WRIST + np.array([x, y, z])

    def bone(start: np.ndarray, end: np.ndarray, radius: float, tip: float) -> None:
        starts.append(start)
        ends.append(end)
        first.append(radius)
        last.append(tip)

    curl, spread = rng.uniform(4, 26), rng.uniform(-1, 5)
    for number, ((x, y), lengths, (radius, tip)) in enumerate(FINGERS):
        place = np.array([x, y, 0.0])
        for share in (-0.35, 0.35):
            bone(of_wrist(0.55 * x, 6, share * 4), place + np.array([0, 0, share * 5]), 10.5, 9.0)
        across = np.radians((1.5 - number) * -spread)
        bend = float(np.radians(curl * rng.uniform(0.6, 1.3)))
        radii = np.linspace(radius, tip, 4)
        angle = 0.4 * bend
        for k, length in enumerate(lengths):
            towards = np.array(
                [np.sin(across) * np.cos(angle), np.cos(across) * np.cos(angle), -np.sin(angle)]
            )
            end = place + length * towards
            bone(place, end - (0 if k < 2 else radii[3]) * towards, radii[k], radii[k + 1])
            if k == 2:
                nails.append((end - 7.5 * towards, towards, np.array([0, np.sin(angle), np.cos(angle)]), tip))
            place, angle = end, angle + bend
    # The ball of the thumb, and the thumb.
    root = np.array([-21.0, -28.0, -6.0])
    middle = root + np.array([-27.0, 25.0, -8.0])
    knuckle = middle + np.array([-15.0, 26.0, -4.0])
    tip_end = knuckle + np.array([-5.0, 22.0, -3.0])
    bone(of_wrist(-8, 8, -4), root, 12.0, 13.5)
    bone(root, middle, 13.5, 10.5)
    bone(middle, knuckle, 10.0, 8.6)
    bone(knuckle, tip_end, 8.6, 7.6)
    bone(of_wrist(18, 10, -6), np.array([24.0, 8.0, -6.0]), 11.0, 11.0)
    ahead = np.array([-5.0, 22.0, -3.0]) / np.linalg.norm([5, 22, 3])
    nails.append((tip_end - 1.0 * ahead, ahead, np.array([-0.35, -0.03, 0.93]), 7.6))
    # The wrist and the arm.
    bone(of_wrist(-9, 4, 0), of_wrist(-9, -40, 0), 15.0, 15.5)
    bone(of_wrist(9, 4, 0), of_wrist(9, -40, 0), 15.0, 15.5)
    body = skin_of(Cones(np.array(starts), np.array(ends), np.array(first), np.array(last)), SOFT_MM, STEP_MM)

    tone = np.array(drawn(SKIN, rng, 0.02))
    skin = Material("hand", tuple(tone.tolist()), label=OCCLUDER, gloss=0.08)  # type: ignore[arg-type]
    high, out = body.vertices[:, 1], body.vertices[:, 2]
    red = np.clip((high - 60) / 70, 0, 1) * 0.5 + np.clip(-out / 25, 0, 1) * 0.5
    paint = tone + red[:, None] * np.array([0.03, -0.035, -0.03])
    parts = [Part(body, np.clip(paint, 0.02, 1), skin)]
    nail_colour = np.clip(tone * 0.9 + np.array([0.11, 0.05, 0.06]), 0, 0.96)
    nail = Material("nails", tuple(nail_colour.tolist()), label=OCCLUDER, gloss=0.35)  # type: ignore[arg-type]
    for place, along, up, radius in nails:
        out = up - (up @ along) * along
        out /= np.linalg.norm(out)
        frame = np.stack([np.cross(along, out), along, out], axis=1)
        radii = np.array([0.74 * radius, 6.2, 1.6])
        parts.append(Part(ball(place + 0.80 * radius * out, radii, frame, 10), nail_colour, nail))
    sleeve = drawn(CLOTH, rng)
    cloth = Material("sleeve", sleeve, label=OCCLUDER)
    arm = np.array([of_wrist(0, y, 0) for y in (-34.0, -60.0, -100.0, -150.0)])
    if rng.random() < 0.55:
        tube = limb(arm, np.array([34.0, 36.0, 40.0, 45.0]), 18, flat=0.8, up=FORWARD)
        parts.append(Part(tube, sleeve, cloth))
    else:
        bare = limb(arm, np.array([24.5, 26.0, 31.0, 36.0]), 18, flat=0.70, up=FORWARD)
        parts.append(Part(bare, tone, skin))
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    half = 180.0 if rng.random() < 0.5 else 0.0
    pose = np.array([half + rng.uniform(-25, 25), rng.uniform(-20, 25), rng.uniform(-70, 70)])
    turn = graphics_rotation(rotation_from_angles(pose))
    size = rng.uniform(0.94, 1.06)
    return [_moved(part, turn, size, mirror) for part in parts]


def _moved(part: Part, turn: np.ndarray, size: float, mirror: float) -> Part:
    vertices = (part.shape.vertices * [mirror, 1, 1] * size) @ turn.T
    triangles = part.shape.triangles if mirror > 0 else part.shape.triangles[:, ::-1]
    return Part(Shape(vertices, triangles), part.colors, part.material)

# SPDX-License-Identifier: GPL-3.0-or-later
"""What glasses consist of: lenses, rims, a bridge, pads and temples, in frame F of the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.worn.face import Face
from generator.worn.shapes import Shape, ball, bar, circle, curve, disc, limb, sweep, unit
from generator.worn.spectacle_frames import Frame

BASE_MM = 190.0
"""Radius that a frame is bent to."""

TILT_DEG = 6.0
"""The lower rim is nearer to the face."""

BULGE_MM = 1.6
"""Of a lens."""

LATERAL_FREE_MM = 1.8
"""Between the side of the head and the middle of a temple."""

MOST_BOW_MM = 9.0
"""What stands farther out than this from a straight temple is hair, which gives way."""


@dataclass(frozen=True, eq=False)
class Front:
    """The bent and tilted surface on which the front of a frame lies, in F. middle: float [3]."""

    middle: np.ndarray

    def at(self, plane: np.ndarray, lift: float | np.ndarray = 0.0) -> np.ndarray:
        """Points [..., 3] of it, float [..., 2] mm from the middle, and lift mm before it."""
        x, y = plane[..., 0], plane[..., 1]
        z = lift - x**2 / (2 * BASE_MM)
        tilt = np.radians(TILT_DEG)
        turned = [x, y * np.cos(tilt) - z * np.sin(tilt), y * np.sin(tilt) + z * np.cos(tilt)]
        return self.middle + np.stack(turned, axis=-1)

    def normals(self, plane: np.ndarray) -> np.ndarray:
        """Where it faces there, float64 [..., 3]."""
        tilt = np.radians(TILT_DEG)
        ones = np.ones_like(plane[..., 0])
        return unit(np.stack([plane[..., 0] / BASE_MM, -np.sin(tilt) * ones, np.cos(tilt) * ones], axis=-1))


def lens(front: Front, outline: np.ndarray) -> Shape:
    """A sheet within an outline [N, 2], counter-clockwise, bent outwards a little."""
    centre = outline.mean(axis=0)
    return disc(front.at(outline), front.at(centre, BULGE_MM))


def rim(front: Front, outline: np.ndarray, frame: Frame, upper: bool = False) -> Shape:
    """Around a lens, counter-clockwise outline [N, 2]; upper: only the bar of a browline along its top."""
    height = np.ptp(outline[:, 1])
    share = np.clip((outline[:, 1] - outline[:, 1].min()) / height, 0, 1)
    low, high = frame.rim_mm
    width, depth = low + (high - low) * share**2, np.full(len(outline), frame.depth_mm)
    if frame.brow and not upper:
        width, depth = np.full(len(outline), low), np.full(len(outline), 1.6)
    if not low:
        width, depth = np.full(len(outline), 0.5), np.full(len(outline), 1.4)
    points = outline
    if upper:
        kept = np.flatnonzero(share > 0.62)
        # From one end of the upper part to the other: it may lie across the end of the list.
        gap = np.flatnonzero(np.diff(kept) > 1)
        order = np.roll(kept, -(gap[0] + 1)) if len(gap) else kept
        points, width, depth = outline[order], width[order], depth[order]
        ends = np.sin(np.pi * np.linspace(0.12, 0.88, len(order))) ** 0.5
        width = high * ends
    profile = bar(1.0, 1.0, 0.45) * np.stack([width, depth], axis=-1)[:, None]
    return sweep(front.at(points), profile, front.normals(points), closed=not upper)


def bridge(face: Face, front: Front, outline: np.ndarray, frame: Frame) -> list[Shape]:
    """What joins the lenses over the nose; outline of the one at image right."""
    top, low = outline[:, 1].max(), outline[:, 1].min()
    made = []
    heights = [0.42] if not frame.double else [0.28, 0.86]
    thick = max(frame.depth_mm * 0.9, 1.5)
    tall = thick if frame.metal else 4.2
    for number, height in enumerate(heights):
        y = (top + low) / 2 + height * (top - low) / 2
        near = outline[outline[:, 0] < outline[:, 0].mean()]
        start = near[np.abs(near[:, 1] - y).argmin()]
        x = np.linspace(-start[0] - 0.3, start[0] + 0.3, 13)
        arch = (1 - (x / start[0]) ** 2) * (2.6 if number == 0 else 0.6)
        plane = np.stack([x, start[1] + arch], axis=1)
        path = front.at(plane, 0.3)
        free = face.front(path[:, 0], path[:, 1]) + tall / 2 + 0.4
        path[:, 2] = np.fmax(path[:, 2], _smooth(np.nan_to_num(free, nan=-1e3)))
        made.append(sweep(path, bar(tall, thick, 0.5), front.normals(plane)))
    return made


def pads(face: Face, front: Front, outline: np.ndarray, side: int, frame: Frame) -> list[Shape]:
    """The pad on one side of the nose, and for frames of metal the wire that holds it."""
    low, top = outline[:, 1].min(), outline[:, 1].max()
    near = outline[outline[:, 0] < outline[:, 0].mean()]
    start = near[np.abs(near[:, 1] - (low + 0.5 * (top - low))).argmin()] * [side, 1]
    rim_point = front.at(start)
    for behind in (4.5, 6.5, 8.5, 10.5, 13.0):
        origin = np.array([[start[0] + front.middle[0], rim_point[1] - 2.5, rim_point[2] - behind]])
        hit = face.cast(origin, np.array([[-side, 0.0, 0.0]]))[0]
        if np.isfinite(hit).all() and 2.5 < side * (hit[0] - front.middle[0]) < side * start[0]:
            break
    else:
        hit = np.array([front.middle[0] + side * 7.0, rim_point[1] - 2.5, rim_point[2] - 6.0])
    out = unit(np.array([side * 0.9, 0.05, 0.42]))
    along = unit(np.array([side * 0.16, 1.0, -0.1]) - out * (side * 0.16 * out[0] + out[1] - 0.1 * out[2]))
    axes = np.stack([out, along, np.cross(out, along)], axis=1)
    centre = hit + 1.1 * out
    made = [ball(centre, np.array([1.0, 5.6, 3.0]), axes, 10)]
    if frame.metal:
        between = (rim_point + centre) / 2 + np.array([side * 0.8, 2, -1.6])
        made.append(limb(curve(np.stack([rim_point, between, centre + 0.4 * out]), 6), 0.5, 6))
    return made


def temple(face: Face, front: Front, outline: np.ndarray, side: int, frame: Frame) -> Shape:
    """From the outer end of the front back over the ear and down behind it."""
    low, top = outline[:, 1].min(), outline[:, 1].max()
    y = (low + top) / 2 + frame.hinge * (top - low) / 2
    far = outline[outline[:, 0] > outline[:, 0].mean()]
    start = far[np.abs(far[:, 1] - y).argmin()]
    skull, ear = face.sides[side], face.sides[side].ear
    begin = front.at(start * [side, 1])
    # Over the front of the ear's root, some millimetres below its top.
    over = np.array([0.0, ear.top - 3.0, 0.35 * ear.front + 0.65 * ear.back + 6.0])
    over[0] = max(float(skull.at(over[1], over[2])), 40.0) + LATERAL_FREE_MM
    corner = np.array([start[0] + 4.2 + side * front.middle[0], begin[1], begin[2] - 4.0])
    corner[0] = max(
        corner[0], float(skull.at(begin[1], corner[2] - 10.0)) + LATERAL_FREE_MM + 0.5
    )  # the face is widest behind the eyes
    share = np.linspace(0, 1, 12)[:, None]
    straight = corner + share * (over - corner)
    free = skull.at(straight[:, 1], straight[:, 2]) + LATERAL_FREE_MM
    bow = np.clip(free - straight[:, 0], 0, None)
    bow[bow > MOST_BOW_MM] = 0.0
    straight[:, 0] += _smooth(bow)
    depth = over[2] - np.array([7.0, 13.0, 17.0])
    drop = over[1] - np.array([4.5, 14.0, 29.0])
    hook = np.stack([np.maximum(skull.at(drop, depth), 35.0) + 1.2, drop, depth], axis=1)
    hook[:, 0] = np.minimum(hook[:, 0], over[0] + 1.0)
    rest = np.vstack([straight, hook]) * [side, 1, 1]
    stub = begin + np.array([side * 1.2, 0, -0.4])
    path = np.vstack([begin, stub, curve(rest, 26)])
    tall = np.interp(np.linspace(0, 1, len(path)), [0, 0.15, 0.7, 1], [1.0, 1.0, 0.75, 0.9])
    tall = tall * (2.2 if frame.metal and not frame.brow else 5.2)
    wide = np.where(np.linspace(0, 1, len(path)) > 0.68, 2.6, 1.5 if frame.metal else 2.3)
    if frame.metal:
        tall = np.where(np.linspace(0, 1, len(path)) > 0.68, np.maximum(tall, 3.2), tall)
    profile = (circle(0.5, 8) if frame.metal else bar(1.0, 1.0, 0.5)) * np.stack([wide, tall], -1)[:, None]
    up = np.tile([0.0, 1.0, 0.0], (len(path), 1))
    bend = np.linspace(0, 1, 9)
    up[-9:] = np.stack([0 * bend, 1 - 0.65 * bend, -0.9 * bend], axis=1)
    return sweep(path, profile, up)


def _smooth(values: np.ndarray) -> np.ndarray:
    """A curve above values that does not jump: the running maximum of three, and their mean above it."""
    wide = np.max(np.stack([np.roll(values, k) for k in (-1, 0, 1)]), axis=0)
    wide[0], wide[-1] = max(values[:2]), max(values[-2:])
    padded = np.pad(wide, 1, mode="edge")
    return np.maximum((padded[:-2] + padded[1:-1] + padded[2:]) / 3, values)

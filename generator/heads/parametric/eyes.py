# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs: a sphere with a cornea in each socket, and the picture of an eye."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from generator.heads.parametric.appearance import EYE_COLORS, Appearance
from generator.heads.parametric.noise import NoiseField, smoothstep

EYE_SIZE = 256
"""Texels along each side of eye.png."""

IRIS_ANGLE = np.deg2rad(24.0)
_RINGS = np.deg2rad([8, 14, 20, 24, 30, 38, 48, 60, 75, 95, 120])
_SEGMENTS = 24
_SPAN = np.deg2rad(100)


@dataclass(frozen=True)
class Eyeball:
    """Centre [3] and radius, dm, of one eye."""

    centre: np.ndarray
    radius: float


def fit_eyeball(helper: np.ndarray) -> Eyeball:
    """The sphere of MakeHuman's eye helper, vertices [K, 3] dm.

    The helper is a sphere with a cornea in front: its width and height give the
    radius, its back the depth.
    """
    low, high = helper.min(0), helper.max(0)
    radius = float((high - low)[:2].mean() / 2)
    centre = (low + high) / 2
    centre[2] = low[2] + radius
    return Eyeball(centre, radius)


def eyeball_vertices(eye: Eyeball, right_deg: float, up_deg: float) -> np.ndarray:
    """Vertices [E, 3] dm of an eye that looks right_deg to +x and up_deg to +y."""
    unit, _, _ = _unit_eye()
    yaw, pitch = np.deg2rad([right_deg, -up_deg])
    turn_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    turn_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return eye.centre + eye.radius * unit @ (turn_y @ turn_x).T


def eyeball_topology() -> tuple[np.ndarray, np.ndarray]:
    """Triangles int32 [T, 3] and texture coordinates [E, 2] (one a vertex), v up."""
    _, triangles, uv = _unit_eye()
    return triangles, uv


@lru_cache(maxsize=1)
def _unit_eye() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    around = np.arange(_SEGMENTS) * 2 * np.pi / _SEGMENTS
    angle = np.concatenate([[0.0], np.repeat(_RINGS, _SEGMENTS)])
    turn = np.concatenate([[0.0], np.tile(around, len(_RINGS))])
    # The cornea stands 5 % of the radius proud of the sphere and ends at the limbus.
    radius = 1 + 0.05 * np.cos(np.minimum(angle / 0.56, 1) * np.pi / 2) ** 2
    vertices = radius[:, None] * np.stack(
        [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], axis=1
    )
    reach = 0.5 * np.minimum(angle / _SPAN, 1)
    uv = 0.5 + reach[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    triangles = []
    for k in range(_SEGMENTS):
        after = (k + 1) % _SEGMENTS
        triangles.append((0, 1 + k, 1 + after))
        for ring in range(len(_RINGS) - 1):
            a, b = 1 + ring * _SEGMENTS + k, 1 + ring * _SEGMENTS + after
            triangles += [(a, a + _SEGMENTS, b + _SEGMENTS), (a, b + _SEGMENTS, b)]
    return vertices, np.array(triangles, dtype=np.int32), uv


class _Front(NamedTuple):
    """The eye seen from the front, [EYE_SIZE * EYE_SIZE]: what all eyes have in common there."""

    radius: np.ndarray  # 1 at the limbus
    sides: np.ndarray
    lid: np.ndarray
    glint: np.ndarray
    vein: np.ndarray
    veins: NoiseField
    fibres: NoiseField


@lru_cache(maxsize=1)
def _front() -> _Front:
    axis = ((np.arange(EYE_SIZE) + 0.5) / EYE_SIZE * 2 - 1).astype(np.float32)
    x, y = (np.float32(_SPAN / IRIS_ANGLE) * plane.ravel() for plane in np.meshgrid(axis, -axis))
    radius, turn = np.hypot(x, y), np.arctan2(y, x)
    return _Front(
        radius=radius,
        sides=1 - 0.25 * smoothstep(1.2, 2.6, np.abs(x)),
        # The upper lid throws a shadow; a window is mirrored in the cornea.
        lid=1 - 0.30 * smoothstep(0.25, 1.1, y),
        glint=0.9 * smoothstep(0.20, 0.13, np.hypot(x + 0.36, y - 0.20)),
        vein=smoothstep(1.2, 2.6, radius),
        veins=NoiseField(turn * 8, radius * 1.5),
        fibres=NoiseField((turn + np.pi) * 16 / np.pi, radius * 1.2),
    )


def paint_eye(look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """The eye seen from the front, azimuthal equidistant, sRGB uint8 [EYE_SIZE, EYE_SIZE, 3]."""
    front = _front()
    white = np.array([0.90, 0.875, 0.85]) - 0.05 * look.ageing * np.array([0.2, 0.5, 1.0])
    veins = 0.03 + 0.05 * np.maximum(front.veins.draw(rng) * front.vein, 0)
    iris = np.array(EYE_COLORS[look.eye_color]) * rng.uniform(0.85, 1.15)
    ring = 0.75 + 0.45 * smoothstep(0.95, 0.45, front.radius) + 0.22 * front.fibres.draw(rng)
    glow = 0.10 * smoothstep(0.62, 0.42, front.radius)
    limbus = 1 - 0.62 * smoothstep(0.78, 1.0, front.radius)
    share = smoothstep(1.05, 0.95, front.radius)
    pupil = rng.uniform(0.34, 0.46)
    shade = (1 - 0.97 * smoothstep(pupil + 0.05, pupil - 0.03, front.radius)) * front.lid
    picture = np.empty((EYE_SIZE * EYE_SIZE, 3), dtype=np.uint8)
    for k, (red, warm) in enumerate(zip((0.3, 1.0, 1.0), (1.0, 0.6, 0.25), strict=True)):
        plane = (np.float32(white[k]) - np.float32(red) * veins) * front.sides
        plane += ((np.float32(iris[k]) * ring + np.float32(warm) * glow) * limbus - plane) * share
        plane *= shade
        plane += (1 - plane) * front.glint
        picture[:, k] = np.clip(plane, 0, 1) * 255 + 0.5
    return picture.reshape(EYE_SIZE, EYE_SIZE, 3)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs: a sphere with a cornea in each socket, and the picture of an eye."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from generator.heads.parametric.appearance import EYE_COLORS, Appearance
from generator.heads.parametric.noise import smooth_noise, smoothstep

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


def paint_eye(look: Appearance, rng: np.random.Generator) -> np.ndarray:
    """The eye seen from the front, azimuthal equidistant, sRGB uint8 [EYE_SIZE, EYE_SIZE, 3]."""
    axis = (np.arange(EYE_SIZE) + 0.5) / EYE_SIZE * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    radius = np.hypot(x, y) * _SPAN / IRIS_ANGLE  # 1 at the limbus
    turn = np.arctan2(y, x)

    white = np.array([0.90, 0.875, 0.85]) - 0.05 * look.ageing * np.array([0.2, 0.5, 1.0])
    veins = smooth_noise(rng, (turn * 8, radius * 1.5)) * smoothstep(1.2, 2.6, radius)
    color = white - (0.03 + 0.05 * np.maximum(veins, 0))[..., None] * np.array([0.3, 1.0, 1.0])
    color = color * (1 - 0.25 * smoothstep(1.2, 2.6, np.abs(x) * _SPAN / IRIS_ANGLE))[..., None]

    iris = np.array(EYE_COLORS[look.eye_color]) * rng.uniform(0.85, 1.15)
    fibres = smooth_noise(rng, ((turn + np.pi) * 16 / np.pi, radius * 1.2))
    ring = 0.75 + 0.45 * smoothstep(0.95, 0.45, radius) + 0.22 * fibres
    inner = iris * ring[..., None]
    inner += (smoothstep(0.62, 0.42, radius) * 0.10)[..., None] * np.array([1.0, 0.6, 0.25])
    inner *= (1 - 0.62 * smoothstep(0.78, 1.0, radius))[..., None]
    color += (inner - color) * smoothstep(1.05, 0.95, radius)[..., None]
    pupil = rng.uniform(0.34, 0.46)
    color *= 1 - 0.97 * smoothstep(pupil + 0.05, pupil - 0.03, radius)[..., None]

    # The upper lid throws a shadow; a window is mirrored in the cornea.
    color *= (1 - 0.30 * smoothstep(0.25, 1.1, y * _SPAN / IRIS_ANGLE))[..., None]
    glint = smoothstep(0.20, 0.13, np.hypot(x * _SPAN / IRIS_ANGLE + 0.36, y * _SPAN / IRIS_ANGLE - 0.20))
    color += (np.array([1.0, 1.0, 1.0]) - color) * 0.9 * glint[..., None]
    return (np.clip(color, 0, 1) * 255 + 0.5).astype(np.uint8)

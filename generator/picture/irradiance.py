# SPDX-License-Identifier: GPL-3.0-or-later
"""What a panorama gives to a surface: irradiance as a quadratic form of the normal.

Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps" (SIGGRAPH 2001):
irradiance keeps the spherical harmonics of light up to degree 2, nine numbers a colour, times pi, 2 pi / 3
and pi / 4. By the addition theorem these are integrals of Legendre polynomials of t = normal . direction,

    E(n) / pi = 1/pi integral L(d) [1/4 + t/2 + 5/32 (3 t^2 - 1)] dd,

so the moments of light of degree 0 to 2 say the same without a basis, and turn as vectors do.

One small and very bright thing, a sun or a lamp, is a direction of its own: of its clamped cosine, degree 2
leaves ripples that are as large as all other light, and a face before the sun would be black in places.

Frame B: x image right, y into the scene, z up. The middle of a panorama is at +y, its right towards +x, its
top at +z.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear RGB (ITU-R BT.709)."""

TERMS = ("1", "x", "y", "z", "xy", "yz", "zx", "xx", "yy")
"""Of the normal; zz is 1 - xx - yy."""

DARK = 1e-9
"""Light below which there is none."""

LEAST = 0.05
"""Share of the mean of what faces the camera that every surface gets at least: no ripple goes below zero."""

FINE = 256
"""Pixels across that are enough: surfaces see no details."""

SUN_RADIUS = np.deg2rad(12.0)
SUN_RISES = 4.0
"""What is that near to the brightest place, and exceeds so many times the mean luminance, is the sun."""


def directions(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors to the pixels of a panorama, float64 [H, W, 3], and the solid angle of each, [H, W]."""
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    edges = np.sin((0.5 - np.arange(height + 1) / height) * np.pi)
    up = np.sin((0.5 - (np.arange(height) + 0.5) / height) * np.pi)
    level = np.sqrt(1 - up**2)
    vectors = np.stack(
        [
            level[:, None] * np.sin(azimuth),
            level[:, None] * np.cos(azimuth),
            np.broadcast_to(up[:, None], (height, width)),
        ],
        axis=-1,
    )
    solid = np.broadcast_to((edges[:-1] - edges[1:])[:, None] * 2 * np.pi / width, (height, width))
    return vectors, solid


def irradiance_form(panorama: np.ndarray) -> np.ndarray:
    """The quadratic forms of a panorama, float64 [3, 4, 4]: (n, 1) . form . (n, 1) is E(n) / pi of a colour.

    panorama: float [H, W, 3], linear RGB. A surface of albedo a sends back a E(n) / pi.
    """
    vectors, solid = directions(*panorama.shape[:2])
    light = panorama.astype(np.float64) * solid[..., None] / np.pi
    extended = np.concatenate([vectors, np.ones((*solid.shape, 1))], axis=-1).reshape(-1, 4)
    # [3, 4, 4]: the moments of degree 0, 1 and 2 of the light.
    moments = np.stack([extended.T @ (extended * light[..., c].reshape(-1, 1)) for c in range(3)])
    form = np.empty((3, 4, 4))
    form[:, :3, :3] = 15 / 32 * moments[:, :3, :3]
    form[:, :3, 3] = form[:, 3, :3] = moments[:, :3, 3] / 4
    form[:, 3, 3] = 3 / 32 * moments[:, 3, 3]
    return form


@dataclass(frozen=True, eq=False)
class Irradiance:
    """The light of a panorama, as surfaces get it.

    form: of all but the sun, see :func:`irradiance_form`. direction: unit vector to the sun, float64 [3].
    sun: RGB that a white surface which faces it sends back, float64 [3]; zero where there is none.
    """

    form: np.ndarray
    direction: np.ndarray
    sun: np.ndarray

    def turned(self, turn_deg: float) -> Irradiance:
        """Of the panorama when it is turned: above zero its middle moves to image right."""
        turn = np.deg2rad(turn_deg)
        back = np.eye(4)  # a normal as the panorama before its turn sees it
        back[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        return Irradiance(back.T @ self.form @ back, back[:3, :3].T @ self.direction, self.sun)

    @property
    def facing(self) -> np.ndarray:
        """Mean colour of a white ball as the camera sees it, float64 [3].

        It is the mean over the hemisphere about -y, weighted by its area in the image, whose moments are 2/3
        along its axis, then 1/2, 1/4 and 1/4. What a sun at an angle g gives is Lambert's phase curve.
        """
        diagonal = self.form[:, [0, 1, 2, 3], [0, 1, 2, 3]] @ [1 / 4, 1 / 2, 1 / 4, 1]
        angle = np.arccos(np.clip(-self.direction[1], -1, 1))
        phase = 2 / (3 * np.pi) * (np.sin(angle) + (np.pi - angle) * np.cos(angle))
        return np.maximum(diagonal - 2 * 2 / 3 * self.form[:, 1, 3] + phase * self.sun, DARK)

    def lit(self, normals: np.ndarray, least: np.ndarray | float = 0.0) -> np.ndarray:
        """What white surfaces send back, float64 [..., 3]; least: of all but the sun. normals: [..., 3]."""
        extended = np.concatenate([normals, np.ones_like(normals[..., :1])], axis=-1)
        rest = np.maximum(np.einsum("...i,cij,...j->...c", extended, self.form, extended), least)
        return rest + np.maximum(normals @ self.direction, 0)[..., None] * self.sun


def irradiance(panorama: np.ndarray) -> Irradiance:
    """What a panorama gives. panorama: float [H, W, 3], linear RGB."""
    if panorama.shape[1] > FINE:
        panorama = cv2.resize(panorama, (FINE, FINE // 2), interpolation=cv2.INTER_AREA)
    vectors, solid = directions(*panorama.shape[:2])
    luminance = panorama @ LUMINANCE
    power = luminance * solid
    limit = SUN_RISES * power.sum() / (4 * np.pi)
    # The brightest place, and no single pixel: of a few degrees.
    rows, columns = (max(1, side // cells) for side, cells in zip(luminance.shape, (64, 128), strict=True))
    ring = np.pad(luminance, ((0, 0), (columns, columns)), mode="wrap")
    gathered = cv2.blur(ring, (columns, rows), borderType=cv2.BORDER_REFLECT)[:, columns:-columns]
    direction = vectors.reshape(-1, 3)[gathered.argmax()]
    share = np.zeros_like(luminance)
    for _ in range(2):  # the second time about its middle, if it is wide
        above = (luminance > limit) & (vectors @ direction > np.cos(SUN_RADIUS))
        share = np.where(above, 1 - limit / np.maximum(luminance, DARK), 0.0)
        towards = np.einsum("hw,hwi->i", power * share, vectors)
        if above.any():
            direction = towards / np.linalg.norm(towards)
    excess = panorama * share[..., None]
    sun = np.einsum("hw,hwc->c", solid, excess) / np.pi
    return Irradiance(irradiance_form(panorama - excess), direction, sun)


def terms(form: np.ndarray) -> np.ndarray:
    """A form as factors of :data:`TERMS`, float64 [9, 3]."""
    m = np.moveaxis(form, 0, -1)
    return np.stack(
        [
            m[3, 3] + m[2, 2],
            *(2 * m[k, 3] for k in range(3)),
            *(2 * m[j, k] for j, k in ((0, 1), (1, 2), (2, 0))),
            m[0, 0] - m[2, 2],
            m[1, 1] - m[2, 2],
        ]
    )

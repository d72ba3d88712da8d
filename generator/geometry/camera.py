# SPDX-License-Identifier: GPL-3.0-or-later
"""The pinhole camera: lens and sensor to K, and the distance that frames a head."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

SENSOR_MM = 36.0
"""Sensor width of a full-frame camera, Blender's default."""


@dataclass(frozen=True)
class Camera:
    """A square pinhole camera that looks along +z of frame C at the head's pivot.

    resolution: image side in pixels. lens_mm: focal length for a 36 mm sensor.
    distance_mm: from the optical centre to the pivot of the rotation.
    """

    resolution: int
    lens_mm: float
    distance_mm: float

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.resolution * self.lens_mm / SENSOR_MM

    @property
    def matrix(self) -> np.ndarray:
        """K, float64 [3, 3], pixels. Pixel (i, j) covers [j, j+1) x [i, i+1): centres at +0.5."""
        centre = self.resolution / 2.0
        return np.array([[self.focal_px, 0, centre], [0, self.focal_px, centre], [0, 0, 1.0]])

    @property
    def translation_mm(self) -> np.ndarray:
        """The pivot in frame C, float64 [3], mm."""
        return np.array([0.0, 0.0, self.distance_mm])

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """Pixels of points in frame C. float [..., 3] mm -> float64 [..., 2] (x, y)."""
        image = np.asarray(points_mm, dtype=np.float64) @ self.matrix.T
        return image[..., :2] / image[..., 2:]

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Directions in frame C (z = 1) through pixels. float [..., 2] -> float64 [..., 3]."""
        centred = (np.asarray(pixels, dtype=np.float64) - self.resolution / 2.0) / self.focal_px
        return np.concatenate([centred, np.ones_like(centred[..., :1])], axis=-1)


def framing_distance(radius_mm: float, lens_mm: float, margin: float) -> float:
    """Distance at which a sphere about the pivot just fits into the image, in mm.

    A sphere of radius r seen from d fills the half-angle asin(r / d), so a head
    inside the sphere stays inside the image at every rotation.

    margin: 1 touches the border; 1.1 leaves a tenth of the radius free.
    """
    if not (radius_mm > 0 and lens_mm > 0 and margin > 0):
        raise ValueError("radius, lens and margin must be positive")
    half_angle = math.atan(SENSOR_MM / 2 / lens_mm)
    return margin * radius_mm / math.sin(half_angle)

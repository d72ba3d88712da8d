# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera: lens and sensor to K, and the distance that frames a head."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

SENSOR_MM = 36.0
"""Sensor width of a full-frame camera, Blender's default."""


Projection = Literal["perspective", "orthographic"]


@dataclass(frozen=True)
class Camera:
    """A camera that looks along +z of frame C, at the head's pivot or past it.

    width, height: of the image in pixels.
    lens_mm: focal length for a sensor 36 mm wide.
    distance_mm: from the optical centre to the pivot of the rotation, along z.
    projection: "perspective" divides by a point's own depth, "orthographic" by
        the pivot's: all rays are parallel, and the scale is the one that the
        perspective camera has at the pivot.
    principal_px: (x, y) of the optical axis, pixels; None is the middle of the image.
    aside_mm: (x, y) of the pivot in frame C, where it is not on the axis.
    pixel_aspect: height of a pixel over its width.
    of_scene: it is the camera of the head's own Blender scene.
    """

    width: int
    height: int
    lens_mm: float
    distance_mm: float
    projection: Projection = "perspective"
    principal_px: tuple[float, float] | None = None
    aside_mm: tuple[float, float] = (0.0, 0.0)
    pixel_aspect: float = 1.0
    of_scene: bool = False

    @classmethod
    def square(
        cls, resolution: int, lens_mm: float, distance_mm: float, projection: Projection = "perspective"
    ) -> Camera:
        """A camera with square images of so many pixels a side."""
        return cls(resolution, resolution, lens_mm, distance_mm, projection)

    @property
    def focal_px(self) -> float:
        """Focal length in widths of a pixel."""
        return self.width * self.lens_mm / SENSOR_MM

    @property
    def focal_xy(self) -> np.ndarray:
        """Focal length in pixels, along x and along y, float64 [2]."""
        return np.array([self.focal_px, self.focal_px / self.pixel_aspect])

    @property
    def view_mm(self) -> float:
        """Width of what is seen at the pivot, mm."""
        return self.distance_mm * SENSOR_MM / self.lens_mm

    @property
    def centre_px(self) -> np.ndarray:
        """Where the optical axis meets the image, float64 [2] (x, y)."""
        return np.array(self.principal_px or (self.width / 2.0, self.height / 2.0), dtype=np.float64)

    @property
    def matrix(self) -> np.ndarray:
        """K, float64 [3, 3], pixels. Pixel (i, j) covers [j, j+1) x [i, i+1): centres at +0.5."""
        (x, y), (across, down) = self.centre_px, self.focal_xy
        return np.array([[across, 0, x], [0, down, y], [0, 0, 1.0]])

    @property
    def translation_mm(self) -> np.ndarray:
        """The pivot in frame C, float64 [3], mm."""
        return np.array([*self.aside_mm, self.distance_mm])

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """Pixels of points in frame C. float [..., 3] mm -> float64 [..., 2] (x, y)."""
        points = np.asarray(points_mm, dtype=np.float64)
        depth = points[..., 2:] if self.projection == "perspective" else self.distance_mm
        return points[..., :2] / depth * self.focal_xy + self.centre_px

    def holds(self, pixels: np.ndarray) -> np.ndarray:
        """Which pixels lie in the image. float [..., 2] -> bool [...]."""
        return ((pixels >= 0) & (pixels <= (self.width, self.height))).all(axis=-1)

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origins (at z = 0) and directions (z = 1) in frame C of the rays through pixels.

        float [..., 2] -> float64 [..., 3] twice.
        """
        centred = (np.asarray(pixels, dtype=np.float64) - self.centre_px) / self.focal_xy
        ones = np.ones_like(centred[..., :1])
        if self.projection == "perspective":
            return np.zeros((*centred.shape[:-1], 3)), np.concatenate([centred, ones], axis=-1)
        origins = np.concatenate([centred * self.distance_mm, 0 * ones], axis=-1)
        return origins, np.concatenate([0 * centred, ones], axis=-1)

    def towards(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rays (origins, directions with z = 1) that meet points in frame C, as :meth:`rays`."""
        return self.rays(self.project(points_mm))


def framing_distance(
    radius_mm: float, lens_mm: float, margin: float, projection: Projection = "perspective"
) -> float:
    """Distance at which a sphere about the pivot just fits into the image, in mm.

    A sphere of radius r seen from d fills the half-angle asin(r / d), so a head
    inside the sphere stays inside the image at every rotation. Without
    perspective it is as wide as the view.

    margin: 1 touches the border; 1.1 leaves a tenth of the radius free.
    """
    if not (radius_mm > 0 and lens_mm > 0 and margin > 0):
        raise ValueError("radius, lens and margin must be positive")
    half_angle = math.atan(SENSOR_MM / 2 / lens_mm)
    reach = math.sin(half_angle) if projection == "perspective" else math.tan(half_angle)
    return margin * radius_mm / reach


def framing_lens(
    radius_mm: float, distance_mm: float, margin: float, projection: Projection = "perspective"
) -> float:
    """Focal length, mm, by which a sphere about the pivot just fits: the inverse of :func:`framing_distance`.

    Raises ValueError where the camera stands inside of that sphere.
    """
    sine = margin * radius_mm / distance_mm
    if not 0 < sine < 1:
        raise ValueError(
            f"a camera {distance_mm:g} mm away stands inside a head of {margin * radius_mm:g} mm"
        )
    reach = sine if projection == "orthographic" else sine / math.sqrt(1 - sine**2)
    return SENSOR_MM / 2 / reach


def framed_margin(
    radius_mm: float, lens_mm: float, distance_mm: float, projection: Projection = "perspective"
) -> float:
    """The margin that a lens at a distance leaves: the other inverse of :func:`framing_distance`."""
    return distance_mm / framing_distance(radius_mm, lens_mm, 1.0, projection)


def isotropic_pixels(
    points_mm: np.ndarray, matrix: np.ndarray, translation_mm: np.ndarray, projection: Sequence[str]
) -> np.ndarray:
    """Points of many rows as a detector would give them: x and y as the row's camera sees them, z the
    depth behind the pivot at the scale of the pivot, (Z - t_z) f / t_z, so that a unit is worth as
    much along each axis.

    Parameters
    ----------
    points_mm: float [N, P, 3], frame C. matrix: float [N, 3, 3], K. translation_mm: float [N, 3].
    projection: N names, see :data:`Projection`.

    Returns
    -------
    float64 [N, P, 3], pixels.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    k = np.asarray(matrix, dtype=np.float64).reshape(-1, 3, 3)
    focal = np.stack([k[:, 0, 0], k[:, 1, 1]], axis=-1)[:, None]
    distance = np.asarray(translation_mm, dtype=np.float64).reshape(-1, 3)[:, None, 2:]
    parallel = np.array([name == "orthographic" for name in projection], dtype=bool)[:, None, None]
    image = points[..., :2] / np.where(parallel, distance, points[..., 2:]) * focal + k[:, None, :2, 2]
    return np.concatenate([image, (points[..., 2:] - distance) * focal[..., :1] / distance], axis=-1)

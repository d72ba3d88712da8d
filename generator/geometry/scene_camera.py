# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera of a Blender scene: its lens, sensor, shifts and pixels to K. numpy and stdlib only."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields, replace
from typing import Any

from generator.geometry.camera import SENSOR_MM, Camera

FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
"""Which side of the image the sensor fits, as Blender names it; AUTO is the longer one."""


@dataclass(frozen=True)
class SceneCamera:
    """A perspective camera as Blender describes it, and where it sees the head's pivot.

    lens_mm: focal length. sensor_width_mm, sensor_height_mm: of the sensor; the height counts where fit is
        VERTICAL alone. fit: place in FITS.
    shift_x, shift_y: of the image, in lengths of the side that fits; y is up.
    pixel_aspect: height of a pixel over its width. width, height: of the scene's own images, pixels.
    pivot_x, pivot_y, pivot_z: of the head's pivot in frame C, mm.
    """

    lens_mm: float
    sensor_width_mm: float
    sensor_height_mm: float
    fit: int
    shift_x: float
    shift_y: float
    pixel_aspect: float
    width: int
    height: int
    pivot_x: float = 0.0
    pivot_y: float = 0.0
    pivot_z: float = 0.0

    @classmethod
    def of_numbers(cls, numbers: tuple[float, ...]) -> SceneCamera:
        """The inverse of :attr:`numbers`. Raises ValueError: there are as many of them as there are not."""
        if len(numbers) != len(fields(cls)):
            raise ValueError(f"a scene's camera has {len(fields(cls))} numbers, got {len(numbers)}")
        given: list[Any] = [*numbers]
        found = cls(*given)
        return replace(found, fit=int(found.fit), width=int(found.width), height=int(found.height))

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its fields in their order, for a table."""
        return tuple(map(float, astuple(self)))

    def size(self, resolution: int) -> tuple[int, int]:
        """Width and height of images of the scene's shape whose longer side has so many pixels."""
        longer = max(self.width, self.height)
        return (
            max(1, round(resolution * self.width / longer)),
            max(1, round(resolution * self.height / longer)),
        )

    def at(self, resolution: int) -> Camera:
        """The camera of images of that size, as Blender's BKE_camera_params_compute_viewplane has it.

        The image is width x (height times the pixels' aspect) units; the sensor spans the side that fits.
        """
        width, height = self.size(resolution)
        tall = height * self.pixel_aspect
        across = width >= tall if self.fit == FITS.index("AUTO") else self.fit == FITS.index("HORIZONTAL")
        vertical = self.fit == FITS.index("VERTICAL")
        sensor = self.sensor_height_mm if vertical else self.sensor_width_mm
        side = width if across else tall
        focal = self.lens_mm / sensor * side
        centre = (
            width / 2 - self.shift_x * side,
            (tall / 2 + self.shift_y * side) / self.pixel_aspect,
        )
        return Camera(
            width,
            height,
            focal * SENSOR_MM / width,
            self.pivot_z,
            "perspective",
            centre,
            (self.pivot_x, self.pivot_y),
            self.pixel_aspect,
            of_scene=True,
        )

# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything besides head and pose that decides a pixel. stdlib only: the render worker reads it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from generator.geometry.camera import Projection


@dataclass(frozen=True)
class RenderSettings:
    """How one image is made.

    resolution: image side in pixels (square). lens_mm: focal length on a 36 mm sensor.
    distance_mm: camera to pivot; None frames each head so that it fits at every pose.
    projection: "perspective", or "orthographic": parallel rays, the scale of the lens at the pivot.
    margin: free space around the head when distance_mm is None (1 = none).
    preset: "fast" (light computed from the normal, noise-free) or "quality" (path traced).
    samples: Cycles samples a pixel.
    light_yaw_deg, light_pitch_deg: where the key light stands, seen from the
        head: 0, 0 is at the camera, yaw > 0 towards image left, pitch > 0 above.
    ambient: share of light that comes from everywhere, 0-1.
    background: sRGB 0-1.
    """

    resolution: int = 256
    lens_mm: float = 85.0
    distance_mm: float | None = None
    margin: float = 1.05
    preset: str = "fast"
    samples: int = 1
    light_yaw_deg: float = 25.0
    light_pitch_deg: float = 35.0
    ambient: float = 0.35
    background: tuple[float, float, float] = (0.5, 0.5, 0.5)
    projection: Projection = "perspective"

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> RenderSettings:
        """The inverse of :meth:`as_dict`; unknown keys are a TypeError."""
        known = {field.name for field in fields(cls)}
        if unknown := set(values) - known:
            raise TypeError(f"unknown render settings: {sorted(unknown)}")
        return cls(**{**values, "background": tuple(values.get("background", cls.background))})

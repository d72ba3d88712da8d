# SPDX-License-Identifier: GPL-3.0-or-later
"""What a render worker is told of the environment that lights an image. stdlib only: Blender imports it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EnvironmentLight:
    """The light of a panorama about the head, turned and as strong as in the image.

    terms: nine RGB of :data:`generator.picture.irradiance.TERMS` of the normal in frame B: their sum is what
        a white surface sends back. least: of that sum. direction, sun: unit vector to its sun in frame B, and
        what that adds to a white surface which faces it; it is no part of the terms.
    file: the panorama. turn_deg: as environment_yaw_deg. scale: what its pixels are multiplied by.
    """

    terms: tuple[tuple[float, float, float], ...]
    least: tuple[float, float, float]
    direction: tuple[float, float, float]
    sun: tuple[float, float, float]
    file: str
    turn_deg: float
    scale: float

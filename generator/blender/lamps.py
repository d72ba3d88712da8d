# SPDX-License-Identifier: GPL-3.0-or-later
"""Where lamps stand and how strong they are, in frame B (x right, y into the scene, z up)."""

from __future__ import annotations

import math

from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look
from generator.plan.shading import Lamp

Vector = tuple[float, float, float]


def direction(yaw_deg: float, pitch_deg: float) -> Vector:
    """Unit vector from the head to a lamp. At yaw 0 it stands at the camera, above zero to image left."""
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    return (
        -math.sin(yaw) * math.cos(pitch),
        -math.cos(yaw) * math.cos(pitch),
        math.sin(pitch),
    )


def key_direction(look: Look) -> Vector:
    """Unit vector from the head to the key light."""
    return direction(look.light_yaw_deg, look.light_pitch_deg)


def key_strengths(look: Look, environment: EnvironmentLight | None) -> tuple[float, float]:
    """Strength of the key light, and of white light from everywhere."""
    return (look.environment_key, 0.0) if environment else (1.0 - look.ambient, look.ambient)


def lamp_light(lamp: Lamp) -> tuple[Vector, Vector]:
    """Unit vector to a lamp, and what it adds to a white surface that faces it, linear RGB."""
    half = lamp.warmth / 2
    color = (lamp.strength * 2**half, lamp.strength, lamp.strength * 2**-half)
    return direction(lamp.yaw_deg, lamp.pitch_deg), color

# SPDX-License-Identifier: GPL-3.0-or-later
"""A head that is turned by hand: about which axis, how far a mouse turns it, and where it comes to rest.

Frames as in docs/conventions.md. View: x right, y up, z towards the viewer. Angles are degrees.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from generator.geometry.rotation import BLENDER_FROM_GRAPHICS, CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.plan.poses import ANGLES

from .words import LIMITS

FACING = 0.5
"""A ring whose axis has so much of the view's is turned round its middle; another one is pushed along."""

EXACT = 1e-4
"""As finely as angles are kept."""

FINE = 0.1
"""How far a fine turn goes, and where it rests."""

_BLENDER_FROM_CAMERA = BLENDER_FROM_GRAPHICS @ CAMERA_FROM_GRAPHICS


def axis(angle: str, pose: Sequence[float]) -> np.ndarray:
    """Float64 [3], unit, frame B: what the head turns about, right-handed, as one of its angles grows.

    R_C = Rx(-pitch) Ry(yaw) Rz(roll): pitch turns about an axis of the camera, yaw about one that pitch has
    moved, roll about the head's own.
    """
    yaw, pitch, _ = pose
    turned = {"pitch": (0.0, 0.0, 0.0), "yaw": (0.0, pitch, 0.0), "roll": (yaw, pitch, 0.0)}[angle]
    column = {"pitch": (-1.0, 0.0, 0.0), "yaw": (0.0, 1.0, 0.0), "roll": (0.0, 0.0, 1.0)}[angle]
    found: np.ndarray = _BLENDER_FROM_CAMERA @ rotation_from_angles(np.array(turned)) @ np.array(column)
    return found


def facing(pose: Sequence[float], view: np.ndarray) -> str:
    """The angle whose axis points most at the viewer, or away. view: [3, 3], frame B to the view's."""
    return max(ANGLES, key=lambda angle: abs(float((view @ axis(angle, pose))[2])))


def swept(
    axis: Sequence[float],
    middle: Sequence[float],
    before: Sequence[float],
    after: Sequence[float],
    radius: float,
) -> float:
    """How far a mouse turns about an axis on its way.

    axis: unit, in the view. middle, before, after: pixels from the lower left. radius: of the ring, pixels.
    A ring that faces the viewer turns with the mouse about its middle; of one that is seen from its side
    the point in front goes with the mouse.
    """
    along = np.asarray(axis, dtype=np.float64)
    start, end = np.subtract(before, middle), np.subtract(after, middle)
    if abs(along[2]) >= FACING:
        turned = np.arctan2(start[0] * end[1] - start[1] * end[0], start @ end)
        return float(np.degrees(turned) * np.sign(along[2]))
    front = np.array([0.0, 0.0, 1.0]) - along[2] * along
    way = np.cross(along, front / np.linalg.norm(front))[:2]
    return float(np.degrees((end - start) @ way / (way @ way) / radius))


def rest(angle: str, start: float, by: float, step: float) -> float:
    """Where an angle comes to rest that is turned by so much: at a multiple of step, within its limits."""
    limit = LIMITS[f"poses.{angle}"]
    return min(max(round(round((start + by) / step) * step, 4), -limit), limit)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head's canonical pose zero is, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.geometry.rotation import angles_from_rotation, graphics_rotation
from generator.landmarks.facing import facing
from generator.landmarks.topology import Topology

SHAPE_SD_DEG = (0.3, 3.2, 0.1)
"""Standard deviation of yaw, pitch and roll of this fit over the 24 heads of
scripts/make_reference_face.py, whose axes agree by construction: a face is not shaped like the
mean face, and above all its profile leaves open where its pitch is zero."""


@dataclass(frozen=True, eq=False)
class Levelling:
    """The rotation from a mesh's own axes to the canonical pose zero.

    correction: R_U, float64 [3, 3]. sd_deg: float64 [3], standard deviation about the axes of
    yaw, pitch and roll: of the mean over views, and of the shape of faces.
    """

    correction: np.ndarray
    sd_deg: np.ndarray


def level(points: np.ndarray, views: np.ndarray, topology: Topology) -> Levelling | None:
    """Rigid alignment of a neutral head's anchors to the reference face; None with too few of them.

    Parameters
    ----------
    points: float [P, 3], anchors, frame C, NaN where absent.
    views: float [V, P, 3], the same from each view alone.
    """
    rotation = facing(points, topology)
    if rotation is None:
        return None
    single = [angles_from_rotation(r) for view in views if (r := facing(view, topology)) is not None]
    noise = np.var(single, axis=0, ddof=1) / len(single) if len(single) > 1 else np.zeros(3)
    return Levelling(graphics_rotation(rotation.T), np.sqrt(noise + np.square(SHAPE_SD_DEG)))

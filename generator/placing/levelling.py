# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the pose zero "level" of a head is, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from generator.geometry.rotation import graphics_rotation
from generator.landmarks.facing import detected_facing
from generator.landmarks.topology import Topology
from generator.placing.anchors import Sighting

SHAPE_SD_DEG = (0.2, 3.6, 0.1)
"""Standard deviation of yaw, pitch and roll of one head's zero over heads whose axes agree by construction,
as scripts/make_anchors.py prints it for 24: a detector reads a face that is not shaped like its own some
degrees high or low."""


@dataclass(frozen=True, eq=False)
class Levelling:
    """The rotation from a mesh's own axes to pose zero.

    correction: R_U, float64 [3, 3]. sd_deg: float64 [3], standard deviation about the axes of
    yaw, pitch and roll: of the mean, and of the shape of faces.
    """

    correction: np.ndarray
    sd_deg: np.ndarray


def level(sightings: Sequence[Sighting], topology: Topology) -> Levelling | None:
    """The zero at which the detector reads a head as level, on average over what it found near the front.

    sightings: of one neutral head. None without any.
    """
    if not sightings:
        return None
    read = np.stack([s.rotation.T @ detected_facing(s.landmarks, topology) for s in sightings])
    mean, noise = mean_rotation(read)
    return Levelling(graphics_rotation(mean.T), np.sqrt(noise**2 + np.square(SHAPE_SD_DEG)))


def level_together(corrections: np.ndarray) -> Levelling:
    """The one zero of heads whose axes agree. corrections: R_U of each, [N, 3, 3]."""
    return Levelling(*mean_rotation(corrections))


def mean_rotation(rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of rotations [N, 3, 3], and the standard error of its yaw, pitch and roll, degrees [3].

    The error of a single one is not known: 0.
    """
    mean = Rotation.from_matrix(rotations).mean()
    off = np.degrees((mean.inv() * Rotation.from_matrix(rotations)).as_rotvec())
    spread = off.std(axis=0, ddof=1) if len(off) > 1 else np.zeros(3)
    # Yaw is about y, pitch about x, roll about z.
    return mean.as_matrix(), spread[[1, 0, 2]] / np.sqrt(len(off))

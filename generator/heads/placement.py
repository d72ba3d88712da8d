# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head stands: what turns the mesh of a source into a head about its pivot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from generator.geometry.scene_camera import SceneCamera
from generator.heads.mesh import HeadMesh
from generator.heads.units import axes_rotation

STRAIGHT = (0.0, 0.0, 0.0)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Placement:
    """What turns a source's mesh into a head in frame U, mm, with its pivot at the origin.

    units, mm_per_unit, up, forward: of the source. pivot: in source units and
    axes. radius_mm: of the sphere about the pivot that holds the head.
    eye_distance_mm: between the outer eye corners. notes: what was guessed.
    frame: "source", "level" or "canonical". correction, correction_sd_deg: of HeadRow; applied by
    :meth:`normalise` only where frame is not "source". turned_deg: yaw, pitch and roll of the face at
    pose zero of the source's axes, where it does not look along them. scene_camera: of the Blender scene
    that the head is in, with where it sees the pivot; no_camera: why there is none that can be used.
    """

    units: str
    mm_per_unit: float
    up: str
    forward: str
    pivot: tuple[float, float, float]
    radius_mm: float
    eye_distance_mm: float
    notes: tuple[str, ...] = ()
    frame: str = "source"
    correction: tuple[float, ...] = IDENTITY
    correction_sd_deg: tuple[float, ...] = (float("nan"),) * 3
    turned_deg: tuple[float, ...] = STRAIGHT
    scene_camera: SceneCamera | None = None
    no_camera: str = ""

    @property
    def levelling(self) -> np.ndarray:
        """R_U [3, 3] that is applied before any pose: the correction, or nothing."""
        return np.array(IDENTITY if self.frame == "source" else self.correction).reshape(3, 3)

    def normalise(self, mesh: HeadMesh) -> HeadMesh:
        """The mesh in frame U at the chosen pose zero, mm, pivot at the origin."""
        pivot = np.array(self.pivot)
        centred = (mesh.vertices - pivot) * self.mm_per_unit
        rotation = self.levelling @ axes_rotation(self.up, self.forward)
        scene = mesh.scene and mesh.scene.moved(rotation, pivot, self.mm_per_unit)
        return replace(mesh, vertices=centred @ rotation.T, scene=scene)

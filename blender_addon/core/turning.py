# SPDX-License-Identifier: GPL-3.0-or-later
"""How a head turns in the user's own scene: as a build of that scene turns it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.heads.scene import BlendScene


@dataclass(frozen=True)
class Turning:
    """pivot: in the world, float64 [3]. head, camera: axes in the world as columns, float64 [3, 3].

    camera is the scene's own, by which poses count then, or the head's: that of a camera in front of it.
    """

    pivot: np.ndarray
    head: np.ndarray
    camera: np.ndarray

    @classmethod
    def of(cls, scene: BlendScene, *, scene_camera: bool) -> Turning:
        """As the host placed the head. ValueError: the scene's camera is asked for and cannot be used."""
        camera = scene.rotation
        if scene_camera:
            if scene.camera is None:
                raise ValueError(scene.no_camera)
            camera = np.array(scene.camera_world).reshape(4, 4)[:3, :3]
        return cls(scene.world(np.zeros(3)), scene.rotation, camera)

    @classmethod
    def of_numbers(cls, numbers: list[float]) -> Turning:
        """The inverse of :attr:`numbers`."""
        values = np.array(numbers)
        return cls(values[:3], values[3:12].reshape(3, 3), values[12:21].reshape(3, 3))

    @property
    def numbers(self) -> list[float]:
        """For a custom property."""
        return [*self.pivot.tolist(), *self.head.reshape(-1).tolist(), *self.camera.reshape(-1).tolist()]

    def at(self, pose: tuple[float, float, float]) -> np.ndarray:
        """Where the turntable stands at (yaw, pitch, roll) in degrees, 4 x 4; as the file stands it is a move
        to the pivot."""
        turn = graphics_rotation(rotation_from_angles(np.array(pose, dtype=np.float64)))
        world = np.eye(4)
        world[:3, :3], world[:3, 3] = self.camera @ turn @ self.head.T, self.pivot
        return world

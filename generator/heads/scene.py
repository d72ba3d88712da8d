# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a mesh that was read from a .blend stands in its scene. numpy and stdlib only: Blender reads it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.geometry.scene_camera import SceneCamera

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Eye:
    """A camera in Blender's world.

    rotation: float64 [3, 3], its axes as columns: image-right, up, back. position: float64 [3].
    mm: millimetres in a unit of Blender.
    """

    rotation: np.ndarray
    position: np.ndarray
    mm: float

    def points(self, world: np.ndarray) -> np.ndarray:
        """Points of the world in frame C, mm. float [..., 3]."""
        return self.directions(world - self.position) * self.mm

    def directions(self, world: np.ndarray) -> np.ndarray:
        """Directions of the world in frame C. float [..., 3]."""
        turned: np.ndarray = world @ self.rotation @ CAMERA_FROM_GRAPHICS
        return turned


@dataclass(frozen=True)
class BlendScene:
    """The scene of a mesh, and where in it the mesh stands.

    file: the .blend. head_object, shape_key: of :class:`generator.heads.head.Head`.
    to_world: 4 x 4, row-major, from the mesh's own coordinates to Blender's world: a turn, a scale, a move.
    camera, camera_world: the scene's own, and its 4 x 4 in the world; None and () where there is none that
        can be used, no_camera says why.
    hair, rest: packages of the head's hair curves and of the rest of the scene, in the mesh's coordinates as
        read; "" where there is none.
    clip: how near and how far the camera sees, in units of Blender; () where there is none.
    """

    file: str
    head_object: str
    shape_key: str
    to_world: Numbers
    camera: SceneCamera | None = None
    camera_world: Numbers = ()
    no_camera: str = ""
    hair: str = ""
    rest: str = ""
    clip: Numbers = ()

    def moved(self, rotation: np.ndarray, pivot: np.ndarray, scale: float) -> BlendScene:
        """The scene of the mesh after x -> scale * rotation @ (x - pivot)."""
        back = np.eye(4)
        back[:3, :3], back[:3, 3] = rotation.T / scale, pivot
        return replace(self, to_world=tuple((self._world @ back).reshape(-1).tolist()))

    def seen_pivot(self, pivot: np.ndarray, mm_per_unit: float) -> SceneCamera | None:
        """The scene's camera, with where it sees a point of the mesh, in the mesh's own coordinates."""
        if self.camera is None:
            return None
        eye = self._own_eye(mm_per_unit * self._scale)
        x, y, z = np.round(eye.points(self.world(pivot)), 6).tolist()
        return replace(self.camera, pivot_x=x, pivot_y=y, pivot_z=z)

    def why_no_camera(self, pivot: np.ndarray, mm_per_unit: float, radius_mm: float) -> str:
        """Why the scene's camera cannot be used for a head about a point of the mesh; "" where it can."""
        seen = self.seen_pivot(pivot, mm_per_unit)
        if seen is None or not self.clip:
            return self.no_camera
        near, far = (mm_per_unit * self._scale * one for one in self.clip)
        nearest, farthest = seen.pivot_z - radius_mm, seen.pivot_z + radius_mm
        if nearest >= near and farthest <= far:
            return ""
        return (
            f"the scene's camera shows what is {near:.0f} to {far:.0f} mm before it (clip start and end), "
            f"and the head is {nearest:.0f} to {farthest:.0f} mm before it"
        )

    def nearest_mm(self, camera: Camera) -> float:
        """How near a camera sees; the mesh is as for :meth:`eye`."""
        return self.clip[0] * self._scale if camera.of_scene and self.clip else 0.0

    def eye(self, camera: Camera) -> Eye:
        """Where a view's camera stands; the mesh is in frame U, mm, its pivot at the origin."""
        mm = self._scale
        if camera.of_scene:
            return self._own_eye(mm)
        rotation = self.rotation
        centre = rotation @ CAMERA_FROM_GRAPHICS @ -camera.translation_mm / mm
        return Eye(rotation, self._world[:3, 3] + centre, mm)

    def world(self, points: np.ndarray) -> np.ndarray:
        """Points of the mesh in Blender's world, float64 [..., 3]."""
        placed: np.ndarray = points @ self._world[:3, :3].T + self._world[:3, 3]
        return placed

    @property
    def rotation(self) -> np.ndarray:
        """The mesh's axes in the world, as columns, float64 [3, 3]."""
        turned: np.ndarray = self._world[:3, :3] * self._scale
        return turned

    @property
    def _world(self) -> np.ndarray:
        return np.array(self.to_world, dtype=np.float64).reshape(4, 4)

    @property
    def _scale(self) -> float:
        """The mesh's units in one of Blender."""
        return float(1 / np.cbrt(np.linalg.det(self._world[:3, :3])))

    def _own_eye(self, mm: float) -> Eye:
        world = np.array(self.camera_world, dtype=np.float64).reshape(4, 4)
        return Eye(world[:3, :3], world[:3, 3], mm)

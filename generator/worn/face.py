# SPDX-License-Identifier: GPL-3.0-or-later
"""A head along its own face: whatever pose zero is, x is across the eyes and z is where the face looks to.

Makers work in this frame, F: x image right, y up, z forward, mm, about the head's pivot, and turn what they
made back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import binary_dilation, grey_opening, label, map_coordinates

from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.landmarks.topology import FACE_MESH
from generator.worn.fit import CannotWear, Fit

FAR_MM = 500.0
"""From where rays start."""

EYES = {
    -1: ((33, 133, 159, 145), (160, 158, 144, 153)),
    1: ((263, 362, 386, 374), (387, 385, 373, 380)),
}
"""Landmarks around the eye at image left and right: corners and lids."""

EAR_STEP_MM = 2.5
EAR_BOX_MM = ((-46.0, 34.0), (-84.0, 34.0))
"""Depth and height, about the pivot, within which an ear is looked for."""

EAR_STANDS_MM = 3.5
"""What stands out of the side of the head by more is an ear, if it is as large as one."""

EAR_AREA_MM2 = (350.0, 3600.0)

EAR_TOP_MM = (-16.0, 24.0)
"""Between these heights an ear has its top; what is lower is hair."""

SMALLEST_FIT = 60
"""Landmarks by which the face's axes are found."""


@dataclass(frozen=True)
class Ear:
    """One ear, or where one should be. side: -1 at image left, 1 at image right.

    found: does it stand out of the surface? top, bottom: heights; front, back: depths, mm in frame F.
    """

    side: int
    found: bool
    top: float
    bottom: float
    front: float
    back: float


class Side:
    """How far the side of a head reaches, with its ear and without it. side: -1 or 1."""

    def __init__(self, face: Face, side: int) -> None:
        (back, front), (low, high) = (-75.0, 115.0), (-110.0, 55.0)
        self._origin = np.array([low, back])
        y, z = np.arange(low, high, EAR_STEP_MM), np.arange(back, front, EAR_STEP_MM)
        grid_y, grid_z = np.meshgrid(y, z, indexing="ij")
        start = np.stack([np.full_like(grid_y, side * FAR_MM), grid_y, grid_z], axis=-1).reshape(-1, 3)
        hits = face.cast(start, np.broadcast_to([-side, 0.0, 0.0], start.shape))[:, 0].reshape(grid_y.shape)
        reach = np.nan_to_num(hits * side, nan=-1.0)
        smooth = grey_opening(reach, size=2 * (int(42 / EAR_STEP_MM),))
        (near, far), (bottom, top) = EAR_BOX_MM
        box = (grid_y > bottom) & (grid_y < top) & (grid_z > near) & (grid_z < far)
        bumps, count = label((reach - smooth > EAR_STANDS_MM) & box & (reach > 0))
        areas = np.bincount(bumps.ravel(), minlength=count + 1)[1:] * EAR_STEP_MM**2
        good = [
            k
            for k in range(count)
            if EAR_AREA_MM2[0] < areas[k] < EAR_AREA_MM2[1]
            and EAR_TOP_MM[0] < grid_y[bumps == k + 1].max() < EAR_TOP_MM[1]
        ]
        self.reach = reach
        if good:
            ear = bumps == 1 + max(good, key=lambda k: areas[k])
            height, depth = grid_y[ear], grid_z[ear]
            self.ear = Ear(
                side, True, float(height.max()), float(height.min()), float(depth.max()), float(depth.min())
            )
            around = binary_dilation(ear, iterations=2)
            self.skull = np.where(around, np.minimum(reach, smooth), reach)
        else:
            self.ear = Ear(side, False, 6.0, -52.0, 16.0, -18.0)
            self.skull = reach

    def at(self, y: np.ndarray, z: np.ndarray, ears: bool = False) -> np.ndarray:
        """Distance from the middle at heights and depths; -1 where there is nothing."""
        y, z = np.broadcast_arrays(np.asarray(y, dtype=np.float64), np.asarray(z, dtype=np.float64))
        where = (np.stack([y.ravel(), z.ravel()]) - self._origin[:, None]) / EAR_STEP_MM
        found = map_coordinates(self.reach if ears else self.skull, where, order=1, mode="nearest")
        return found.reshape(y.shape)


@dataclass(frozen=True, eq=False)
class Face:
    """A head in frame F. fit: the head as it is. rotation: [3, 3], from F to U. scale: to the mean face."""

    fit: Fit
    rotation: np.ndarray
    scale: float

    @classmethod
    def of(cls, fit: Fit) -> Face:
        """The face of a head; of the same head again the same one, with all that it knows already.

        Raises CannotWear without one.
        """
        return fit.once("face", lambda: cls._found(fit))

    @classmethod
    def _found(cls, fit: Fit) -> Face:
        known = np.isfinite(fit.points).all(axis=1)
        if known.sum() < SMALLEST_FIT:
            raise CannotWear(f"{int(known.sum())} landmarks have a place on the mesh, too few for a face")
        mean = FACE_MESH.surface_face()
        known &= np.isfinite(mean).all(axis=1)
        found = fit_similarity(mean[known], fit.points[known])
        level = rotation_from_angles(np.array([0.0, FACE_MESH.level_pitch_deg, 0.0]))
        return cls(fit, found.rotation @ graphics_rotation(level), found.scale)

    def at(self, *places: int) -> np.ndarray:
        """Landmarks in F, float64 [N, 3]. Raises CannotWear if one has no place."""
        return self.fit.at(*places) @ self.rotation

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """As :meth:`Fit.cast`, in F."""
        back = self.rotation.T
        return self.fit.cast(np.asarray(origins) @ back, np.asarray(directions) @ back) @ self.rotation

    def outermost(self, centre: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """As :meth:`Fit.outermost`, in F."""
        return self.fit.outermost(self.rotation @ centre, directions @ self.rotation.T)

    def front(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Depth z of the foremost surface at places, NaN where there is none."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        start = np.stack([x.ravel(), y.ravel(), np.full(x.size, FAR_MM)], axis=1)
        return self.cast(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape))[:, 2].reshape(x.shape)

    @cached_property
    def vertices(self) -> np.ndarray:
        """Of the head, in F, float64 [V, 3]."""
        return self.fit.mesh.vertices @ self.rotation

    @cached_property
    def sides(self) -> dict[int, Side]:
        """The sides of the head, by -1 and 1."""
        return {side: Side(self, side) for side in (-1, 1)}

    def pupil(self, side: int) -> np.ndarray:
        """The middle of an eye's opening, float64 [3]."""
        corners, lids = EYES[side]
        return (self.at(*corners).mean(axis=0) + self.at(*lids).mean(axis=0)) / 2

    def back(self, mesh: HeadMesh) -> HeadMesh:
        """A mesh in F as one in the head's frame U."""
        return replace(mesh, vertices=mesh.vertices @ self.rotation.T)

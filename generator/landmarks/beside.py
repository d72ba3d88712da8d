# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a Blender scene hides landmarks besides the head's surface: its hair, and what is around."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.geometry.camera import Camera
from generator.geometry.rotation import rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.heads.package import load_package
from generator.heads.placement import Placement
from generator.heads.scene import BlendScene
from generator.landmarks.surface import TOGETHER, Surface
from generator.plan.views import Views


class Beside:
    """The hair turns with the head; what else there is stands still before the camera.

    scene: of the head in frame U, mm, pivot at the origin. placement: of the head in it.
    """

    def __init__(self, scene: BlendScene, placement: Placement) -> None:
        self._hair = _placed(scene.hair, placement)
        self._rest = _placed(scene.rest, placement)
        self._scene = scene
        self._still: dict[bool, Surface] = {}

    def hides(self, points: np.ndarray, views: Views) -> np.ndarray:
        """Which points are hidden in each view, bool [N, P]. points: as of :meth:`Surface.visible`."""
        hidden = np.zeros((len(views), len(points)), dtype=bool)
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        rotations = rotation_from_angles(views.angles_deg)
        if self._hair is not None:
            hair = Surface(self._hair)
            for start in range(0, len(views), TOGETHER):
                few = slice(start, start + TOGETHER)
                cameras = [view.camera for view in views[few]]
                hidden[few, known] = hair.hides(points[known], rotations[few], cameras)
        if self._rest is not None:
            for row, view in enumerate(views):
                posed = points[known] @ rotations[row].T
                before, near = self._before(view.camera), self._scene.nearest_mm(view.camera)
                [behind] = before.hides(posed, np.eye(3)[None], [view.camera], from_mm=near)
                hidden[row, known] |= behind
        return hidden

    def _before(self, camera: Camera) -> Surface:
        """The rest of the scene with the axes of a camera: frame C, but about the pivot."""
        if camera.of_scene not in self._still:
            assert self._rest is not None, "asked for only where there is something"
            eye = self._scene.eye(camera)
            away = self._scene.world(self._rest.vertices) - self._scene.world(np.zeros(3))
            aligned = away @ eye.rotation * eye.mm
            self._still[camera.of_scene] = Surface(replace(self._rest, vertices=aligned))
        return self._still[camera.of_scene]


def _placed(file: str, placement: Placement) -> HeadMesh | None:
    return placement.normalise(load_package(Path(file))) if file else None

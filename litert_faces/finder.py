# SPDX-License-Identifier: MIT
"""A picture in, faces with their landmarks out: MediaPipe's FaceMesh in its static mode."""

from __future__ import annotations

import numpy as np

from litert_faces.blendshapes import BlendshapeNetwork
from litert_faces.boxes import BoxDetector, Boxes
from litert_faces.errors import FinderError
from litert_faces.files import TASK, networks
from litert_faces.landmarks import LandmarkNetwork, square_around, squares
from litert_faces.network import Network, PictureNetwork


class FaceFinder:
    """name: what decides the points: networks and LiteRT. count: points of a face, 468 or 478.

    source: which networks, see :func:`litert_faces.files.networks`. Raises FinderError: they are not there,
    or none of faces, or LiteRT is not installed.
    """

    def __init__(self, source: str) -> None:
        from importlib.metadata import version  # a tenth of the time of all imports

        found = networks(source)
        self._found = found
        self._near = BoxDetector(PictureNetwork(found.near, f"{found.where}: detector"))
        self._points = LandmarkNetwork(PictureNetwork(found.points, f"{found.where}: landmarks"))
        far = found.far
        self._far = None if far is None else BoxDetector(PictureNetwork(far, f"{found.where}: far"))
        self._blendshapes: BlendshapeNetwork | None = None
        self.count = self._points.count
        self.name = f"litert-{self.count} {found.digest} ai-edge-litert {version('ai-edge-litert')}"

    def faces(self, rgb: np.ndarray, limit: int = 1, min_confidence: float = 0.5) -> list[np.ndarray]:
        """Landmarks of the surest faces, at most so many: each float64 [P, 3]. rgb: uint8 [H, W, 3]."""
        boxes = self._near.find(rgb, min_confidence)
        places = squares(boxes.take(np.arange(min(limit, len(boxes)))))
        found = (self._points.points(rgb, square) for square in places)
        return [points for points in found if points is not None]

    def far(self, rgb: np.ndarray, min_confidence: float = 0.5) -> Boxes | None:
        """Where the full-range detector sees faces, which sees those half as large; None without one."""
        return None if self._far is None else self._far.find(rgb, min_confidence)

    @property
    def has_blendshapes(self) -> bool:
        """Whether a network for them is among these."""
        return self._found.blendshapes is not None

    def again(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """All points of a face of which those of Face Mesh are known, float [468, 3] or more, pixels: float64
        [P, 3]; None where the network sees no face there."""
        return self._points.points(rgb, square_around(face))

    def blendshapes(self, points: np.ndarray) -> np.ndarray:
        """What a face does: float32 [52], 0 to 1, by the names of :data:`litert_faces.blendshapes.NAMES`.

        points: float [478, 3], pixels, as :meth:`faces` and :meth:`again` give them. FinderError: other
        points, or there is no such network among these, which a face_landmarker.task alone has.
        """
        if self._blendshapes is None:
            content, where = self._found.blendshapes, self._found.where
            if content is None:
                raise FinderError(f"{where}: has no {TASK.blendshapes}; give a face_landmarker.task")
            self._blendshapes = BlendshapeNetwork(Network(content, f"{where}: blendshapes"))
        return self._blendshapes.scores(points)

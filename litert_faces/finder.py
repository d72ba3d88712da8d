# SPDX-License-Identifier: MIT
"""A picture in, faces with their landmarks out: MediaPipe's FaceMesh in its static mode."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from litert_faces.boxes import BoxDetector, Boxes
from litert_faces.files import networks
from litert_faces.landmarks import LandmarkNetwork, squares
from litert_faces.network import Network


class FaceFinder:
    """name: what decides the points: networks and LiteRT. count: points of a face, 468 or 478.

    source: which networks, see :func:`litert_faces.files.networks`. Raises FinderError: they are not there,
    or none of faces, or LiteRT is not installed.
    """

    def __init__(self, source: str) -> None:
        found = networks(source)
        self._near = BoxDetector(Network(found.near, f"{found.where}: detector"))
        self._points = LandmarkNetwork(Network(found.points, f"{found.where}: landmarks"))
        self._far = None if found.far is None else BoxDetector(Network(found.far, f"{found.where}: far"))
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

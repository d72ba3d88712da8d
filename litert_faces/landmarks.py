# SPDX-License-Identifier: MIT
"""Where the points of a face are: Face Mesh's network, or Face Landmarker's, on a square around it."""

from __future__ import annotations

import numpy as np

from litert_faces.boxes import Boxes
from litert_faces.crop import Square
from litert_faces.errors import FinderError
from litert_faces.network import PictureNetwork

WITH_IRISES = 478
POINTS = {3 * 468, 3 * WITH_IRISES}
"""How many numbers the network gives: without and with the irises."""
RIGHT_EYE, LEFT_EYE = 33, 263
"""Outer corners of the subject's eyes, which a square around known points is level with.
face_landmark_landmarks_to_roi.pbtxt."""
ROOM = 1.5
"""Side of the square, in longer sides of the box. face_detection_front_detection_to_roi.pbtxt."""
SAME = 0.5
"""Squares that share more are of one face. face_landmark_front_cpu.pbtxt: AssociationNormRectCalculator."""
LEAST_PRESENCE = 0.5
"""How sure the network must be that there is a face: what mediapipe's FaceMesh has by default."""


class LandmarkNetwork:
    """FinderError: the network has not the outputs of one. count: P, 468 or 478."""

    def __init__(self, network: PictureNetwork) -> None:
        self._network = network
        if network.sizes[0] not in POINTS or network.sizes[1:2] != (1,):
            raise FinderError(
                f"{network.name}: no network of landmarks, its outputs have sizes {network.sizes}"
            )
        self.count = network.sizes[0] // 3

    def points(self, rgb: np.ndarray, square: Square) -> np.ndarray | None:
        """float64 [P, 3], pixels, the depth in the same unit; None where the network sees no face."""
        size = self._network.size
        values, presence = self._network(square.cut(rgb, size, 0, replicate=True))[:2]
        if not 1 / (1 + np.exp(-float(presence[0]))) > LEAST_PRESENCE:
            return None
        places = values.reshape(self.count, 3).astype(np.float64) / size
        return np.column_stack([square.pixels(places[:, :2]), square.side * places[:, 2]])


def squares(boxes: Boxes) -> list[Square]:
    """Around each face, level with its eyes; where two overlap by half, the later one stays."""
    found: list[Square] = []
    for low, high, points in zip(boxes.low, boxes.high, boxes.points, strict=True):
        square = _level(low, high, points[0], points[1])
        found = [other for other in found if other.overlap(square) <= SAME]
        found.append(square)
    return found


def square_around(face: np.ndarray) -> Square:
    """Where a face lies of which points are known, [468, 3] or more."""
    flat = face[:, :2]
    return _level(flat.min(axis=0), flat.max(axis=0), flat[RIGHT_EYE], flat[LEFT_EYE])


def _level(low: np.ndarray, high: np.ndarray, right_eye: np.ndarray, left_eye: np.ndarray) -> Square:
    x, y = left_eye - right_eye
    return Square((low + high) / 2, ROOM * float((high - low).max()), float(np.arctan2(y, x)))

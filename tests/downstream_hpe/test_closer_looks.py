# SPDX-License-Identifier: MIT
"""Which faces are looked at again in a square around them, and what comes of it."""

from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.prediction.detector import CLOSER, LARGE_ENOUGH, FaceDetector
from downstream_hpe.prediction.plausibility import FaceShapes

SIDE = 400
"""Pixels of the picture's longer side."""
OFF = np.array([2.0, 1.0, 0.0])
"""How far off a first look is."""


class OneFace(FaceDetector):
    """A detector whose mesh sees the face of size pixels at centre: OFF in the whole picture, right in a
    square cut out of it; of the squares it remembers the sides."""

    def __init__(self, size: float, centre=(250.0, 120.0), blind_closely: bool = False):
        super().__init__()
        points = FaceShapes.load().mean
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        middle = np.array([*(low + high) / 2, 0])
        self.truth = (points - middle) * size / (high - low).max() + [*centre, 0.0]
        self.blind_closely = blind_closely
        self.squares: list[tuple[int, ...]] = []

    def mesh(self, rgb, limit=1):
        if max(rgb.shape) == SIDE:
            return [self.truth + OFF]
        self.squares.append(rgb.shape[:2])
        # The picture's pixels say where they are: their red is the column, their green the row, in twos.
        return [] if self.blind_closely else [self.truth - [*(2 * rgb[0, 0, :2].astype(float)), 0]]

    def _far_faces(self, rgb):
        return []


@pytest.fixture
def picture():
    """BGR, 300 rows: each pixel says where it is."""
    rows, columns = np.indices((300, SIDE)) // 2
    return np.stack([np.zeros_like(rows), rows, columns], axis=-1).astype(np.uint8)


def test_a_small_face_is_looked_at_again_and_the_closer_look_counts(picture):
    size = 0.9 * LARGE_ENOUGH * SIDE
    looks = OneFace(size)
    [face] = looks.faces(picture)
    [square] = looks.squares
    assert max(square) == pytest.approx(CLOSER * size, abs=2), "how much of the picture is shown"
    assert np.abs(face - looks.truth)[:, :2].max() < 1.01, "pixels say even numbers"
    np.testing.assert_array_equal(face[:, 2], looks.truth[:, 2])


def test_a_large_face_is_not(picture):
    looks = OneFace(1.1 * LARGE_ENOUGH * SIDE)
    [face] = looks.faces(picture)
    assert not looks.squares
    np.testing.assert_array_equal(face, looks.truth + OFF)


def test_where_a_closer_look_shows_nothing_the_first_one_counts(picture):
    looks = OneFace(60.0, blind_closely=True)
    [face] = looks.faces(picture)
    assert len(looks.squares) == 1
    np.testing.assert_array_equal(face, looks.truth + OFF)

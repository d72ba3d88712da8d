# SPDX-License-Identifier: MIT
"""Where faces are: what MediaPipe's two detectors of boxes say, on their anchors, and what is left of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from litert_faces.crop import Square
from litert_faces.errors import FinderError
from litert_faces.network import PictureNetwork

VALUES = 16
"""A box: centre, size, six points of the face; two numbers each, in pixels of the network's picture."""
STRIDES = {896: ((8, 2), (16, 6)), 2304: ((4, 1),)}
"""By how many anchors a network has, short and full range: pixels between them, and how many lie at a place.
MediaPipe's face_detection_short_range.pbtxt and face_detection_full_range.pbtxt."""
OVERLAP = 0.3
"""Boxes that share more are of one face. face_detection.pbtxt: NonMaxSuppressionCalculator."""
HIGHEST = 100.0
"""Of what goes into the logistic function. face_detection.pbtxt: score_clipping_thresh."""


@dataclass(frozen=True)
class Boxes:
    """score [N]; low, high [N, 2], corners; points [N, 6, 2]: the eyes, right one first, nose, mouth, ears.
    The surest first."""

    score: np.ndarray
    low: np.ndarray
    high: np.ndarray
    points: np.ndarray

    def __len__(self) -> int:
        return len(self.score)

    def take(self, chosen: np.ndarray) -> Boxes:
        """Some of them, by their places or by a bool each."""
        return Boxes(self.score[chosen], self.low[chosen], self.high[chosen], self.points[chosen])


class BoxDetector:
    """A network of MediaPipe's that finds faces. FinderError: it has not the outputs of one."""

    def __init__(self, network: PictureNetwork) -> None:
        self._network = network
        count = network.sizes[-1]
        if count not in STRIDES or network.sizes != (VALUES * count, count):
            raise FinderError(f"{network.name}: no detector of faces, its outputs have sizes {network.sizes}")
        self._anchors = anchors(network.size, STRIDES[count])

    def find(self, rgb: np.ndarray, min_confidence: float) -> Boxes:
        """Faces of a picture, pixels."""
        whole = Square.around(rgb)
        values, scores = self._network(whole.cut(rgb, self._network.size, -1, replicate=False))
        found = merged(decoded(values, scores, self._anchors, self._network.size, min_confidence))
        low, high, points = (whole.pixels(places) for places in (found.low, found.high, found.points))
        return Boxes(found.score, low, high, points)


def anchors(size: int, strides: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Middles of the cells of each grid, 0 to 1, row by row: float64 [A, 2], (x, y).

    As SsdAnchorsCalculator gives them with fixed_anchor_size: all boxes are of size 1.
    """
    grids = []
    for stride, many in strides:
        middles = (np.arange(size // stride) + 0.5) * stride / size
        y, x = np.meshgrid(middles, middles, indexing="ij")
        grids.append(np.repeat(np.stack([x.ravel(), y.ravel()], axis=1), many, axis=0))
    return np.concatenate(grids)


def decoded(
    values: np.ndarray, scores: np.ndarray, places: np.ndarray, size: int, min_confidence: float
) -> Boxes:
    """Boxes of those anchors that are sure enough, 0 to 1, the surest first.

    values: [A * VALUES], scores: [A], as the network gives them. places: :func:`anchors`.
    """
    score = 1 / (1 + np.exp(-np.clip(scores.astype(np.float64), -HIGHEST, HIGHEST)))
    pairs = values.reshape(len(places), VALUES // 2, 2).astype(np.float64) / size
    centre, extent = pairs[:, 0] + places, pairs[:, 1]
    found = Boxes(score, centre - extent / 2, centre + extent / 2, pairs[:, 2:] + places[:, None])
    chosen = np.flatnonzero((score >= min_confidence) & (extent >= 0).all(axis=1))
    return found.take(chosen[np.argsort(-score[chosen], kind="stable")])


def merged(boxes: Boxes) -> Boxes:
    """One a face: the mean of those that overlap the surest, weighted by how sure they are; and again of the
    rest. WeightedNonMaxSuppression of NonMaxSuppressionCalculator."""
    kept: list[Boxes] = []
    while len(boxes):
        reach = np.minimum(boxes.high, boxes.high[0]) - np.maximum(boxes.low, boxes.low[0])
        shared = np.clip(reach, 0, None).prod(axis=1)
        areas = (boxes.high - boxes.low).prod(axis=1)
        same = shared > OVERLAP * (areas + areas[0] - shared)
        if not same[0]:  # of no size
            same = np.arange(len(boxes)) == 0
        one = boxes.take(same)
        weights = one.score / one.score.sum()
        means = (np.tensordot(weights, part, 1)[None] for part in (one.low, one.high, one.points))
        kept.append(Boxes(one.score[:1], *means))
        boxes = boxes.take(~same)
    parts = ((one.score, one.low, one.high, one.points) for one in kept)
    return Boxes(*map(np.concatenate, zip(*parts, strict=True))) if kept else boxes

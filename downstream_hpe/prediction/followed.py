# SPDX-License-Identifier: MIT
"""Several faces of a video: those that a look at the whole frame does not show are looked for and followed.

A picture is looked at in all of its tiles, and so is the first frame. Then a video keeps its rate: a few
tiles of each frame are looked at, in turns, and the places where the frame before had faces.
"""

from __future__ import annotations

from itertools import cycle, islice

import numpy as np

from downstream_hpe.prediction.crowd import is_new, tiles
from downstream_hpe.prediction.detector import place_of
from downstream_hpe.prediction.landmarkers import Place
from downstream_hpe.prediction.predictor import Predictor

TILES_A_FRAME = 2


class Followed:
    """Of one video, whose frames all have a width and height."""

    def __init__(self, width: int, height: int) -> None:
        every = list(tiles(width, height))
        self._tiles, self._now = cycle(every), len(every)
        self._places: list[Place] = []

    def and_others(self, predictor: Predictor, bgr: np.ndarray, found: np.ndarray, limit: int) -> np.ndarray:
        """Landmarks [F, 468, 3]: found, which the whole frame shows, and others, at most limit in all."""
        faces = list(found)
        for place in self._places:
            if len(faces) < limit and is_new(place, [place_of(face) for face in faces]):
                face = predictor.face_at(bgr, place)
                if face is not None and is_new(place_of(face), [place_of(one) for one in faces]):
                    faces.append(face)
        for tile in islice(self._tiles, self._now):
            if len(faces) >= limit:
                break
            faces += predictor.faces_in_tile(bgr, tile, faces)
        self._now = TILES_A_FRAME
        faces = faces[:limit]
        self._places = [place_of(face) for face in faces]
        return np.array(faces).reshape(-1, *found.shape[1:])

# SPDX-License-Identifier: MIT
"""Which way up a video is looked at, so that a head on its side or upside down is found as in a picture.

A picture may take many looks; a video keeps its rate. So a frame is turned as the one before was, and only
where that shows no plausible face all quarter turns are tried: at once, and then no oftener than PATIENCE_S.
A frame is looked at one way up: of several faces that lie differently, one decides.
"""

from __future__ import annotations

import numpy as np

from downstream_hpe.prediction.detector import DOUBTFUL, turned_back
from downstream_hpe.prediction.followed import Followed
from downstream_hpe.prediction.plausibility import FaceShapes, quarter_turns
from downstream_hpe.prediction.predictor import Predictor

PATIENCE_S = 1.0


class WayUp:
    """Of one video. quarter: by how many quarters, counter-clockwise, its frames are turned."""

    def __init__(self) -> None:
        self.quarter = 0
        self._tried_s = -np.inf
        self._followed: Followed | None = None

    def faces(self, predictor: Predictor, bgr: np.ndarray, limit: int, time_s: float) -> np.ndarray:
        """Landmarks [F, 468, 3] in the pixels of a frame as it is, as :meth:`Predictor.faces`."""
        turned = np.ascontiguousarray(np.rot90(bgr, self.quarter))
        seen = predictor.faces(turned, limit, False)
        if limit > 1:
            if self._followed is None:
                self._followed = Followed(turned.shape[1], turned.shape[0])
            seen = self._followed.and_others(predictor, turned, seen, limit)
        found = turned_back(seen, bgr, self.quarter)
        if len(_plausible(found)) or time_s - self._tried_s < PATIENCE_S:
            return found
        self._tried_s = time_s
        again = predictor.faces(bgr, limit, True)
        plausible = _plausible(again)
        if len(plausible):
            before, self.quarter = self.quarter, int(quarter_turns(plausible)[0])
            if self.quarter != before:
                self._followed = None
        return again if len(again) else found


def _plausible(faces: np.ndarray) -> np.ndarray:
    """Those that a picture's would not be looked at again."""
    return faces[FaceShapes.load().plausibility(faces) > DOUBTFUL]

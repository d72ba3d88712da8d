# SPDX-License-Identifier: MIT
"""MediaPipe's face mesh: how many points, which of them have names, which are each other's mirror.

Everything else that depends on the mesh follows from here.
"""

from __future__ import annotations

import numpy as np

TOPOLOGY = "mediapipe-face-mesh-468"
"""Its name in the metadata of the tables."""
POINTS = 468
WITH_IRISES = POINTS + 10
"""Of the mesh with refined landmarks: the same points, then five of each iris."""
FEATURES = 3 * POINTS
"""Numbers of one face, its landmarks flattened."""

NOSE_TIP, FOREHEAD, CHIN = 1, 10, 152
RIGHT_EYE, LEFT_EYE = 33, 263
"""The outer corners of the subject's eyes."""

IBUG_INNER = (
    71, 63, 105, 66, 107, 336, 296, 334, 293, 301, 168, 197, 5, 4, 75, 97, 2, 326, 305,
    33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380,
    61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181, 78, 82, 13, 312, 308, 317, 14, 87,
)  # fmt: skip
"""Of iBUG's 68 points the last 51, brows to lips. Its jaw is left out: it moves with the outline that a
turned face shows."""

_MIDDLE = np.array([*range(3), *range(4, 7), *range(8, 20), 94, 151, 152, 164, 168, 175, 195, 197, 199, 200])
_FIRST_LEFT = 248
"""The points of the subject's right side are numbered first; the left side has the same order."""


def mirror_pairs() -> np.ndarray:
    """Index of each point's mirror partner, int [468]; points of the middle are their own."""
    pairs = np.arange(POINTS)
    right = np.setdiff1d(pairs[:_FIRST_LEFT], _MIDDLE)
    left = np.arange(_FIRST_LEFT, POINTS)
    pairs[right], pairs[left] = left, right
    return pairs

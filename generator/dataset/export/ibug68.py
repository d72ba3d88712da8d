# SPDX-License-Identifier: GPL-3.0-or-later
"""The 68 points of iBUG 300-W (dlib, 300W-LP, COCO-WholeBody's face) among the 468 of Face Mesh."""

from __future__ import annotations

import numpy as np

# The subset in common use. It is symmetric: mirroring the face maps it onto itself. Right is the
# subject's right, image left. The jaw lies on the mesh, not on the outline that a turned face shows.
JAW = (162, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 389)
RIGHT_BROW, LEFT_BROW = (71, 63, 105, 66, 107), (336, 296, 334, 293, 301)
NOSE_BRIDGE, NOSE_BASE = (168, 197, 5, 4), (75, 97, 2, 326, 305)
RIGHT_EYE, LEFT_EYE = (33, 160, 158, 133, 153, 144), (362, 385, 387, 263, 373, 380)
OUTER_LIPS = (61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181)
INNER_LIPS = (78, 82, 13, 312, 308, 317, 14, 87)

_GROUPS = {
    "jaw": JAW,
    "right_brow": RIGHT_BROW,
    "left_brow": LEFT_BROW,
    "nose_bridge": NOSE_BRIDGE,
    "nose_base": NOSE_BASE,
    "right_eye": RIGHT_EYE,
    "left_eye": LEFT_EYE,
    "outer_lips": OUTER_LIPS,
    "inner_lips": INNER_LIPS,
}
_CLOSED = ("right_eye", "left_eye", "outer_lips", "inner_lips")

IBUG_68 = np.array([index for group in _GROUPS.values() for index in group])
"""int64 [68]: place of iBUG point i (from 0) among the 468."""

NAMES = tuple(f"{name}_{k + 1}" for name, group in _GROUPS.items() for k in range(len(group)))
"""A name a point, in iBUG's order."""


def skeleton() -> list[tuple[int, int]]:
    """Lines between points for drawing, as pairs of places from 0."""
    lines: list[tuple[int, int]] = []
    start = 0
    for name, group in _GROUPS.items():
        stop = start + len(group)
        lines += [(k, k + 1) for k in range(start, stop - 1)]
        if name in _CLOSED:
            lines.append((stop - 1, start))
        start = stop
    return lines

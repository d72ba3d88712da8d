# SPDX-License-Identifier: GPL-3.0-or-later
"""What make_scene.py makes, worked out with nothing but numpy: from a vertex of the mesh to a pixel."""

from __future__ import annotations

import numpy as np

PLACE = np.array([0.3, -0.2, 1.5])
ASPECT = 1.25


def axis(name: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return {
        "X": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "Y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "Z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[name]


TURN = axis("Z", 30) @ axis("X", 90)
"""Of the face in the world."""

CAMERA = axis("Z", 10) @ axis("X", 86) @ axis("Z", 5)
CAMERA_PLACE = np.array([0.5, -1.6, 1.62])
FRAME_C = np.diag([1.0, -1.0, -1.0])


def surface_mm(vertices: np.ndarray, smile: bool) -> np.ndarray:
    """The face's own vertices as they are rendered: shape key, then the bone. float [V, 3], mm, both."""
    points = vertices / 10
    low, high = points[:, 1].min(), points[:, 1].max()
    jaw = points[:, 1] < low + 0.45 * (high - low)
    points = points + np.array([0.0, 0.3, 0.0]) * (jaw[:, None] & smile)
    # The bone lies along z, so that its own x axis is the armature's.
    return np.where(jaw[:, None], points @ axis("X", 4).T, points) * 10


def camera_matrix(width: int, height: int) -> np.ndarray:
    """K: 70 mm before a sensor 20 mm high, on pixels 1.25 as high as wide, shifted by parts of the height."""
    tall = height * ASPECT
    focal = 70.0 / 20.0 * tall
    centre = width / 2 - 0.1 * tall, (tall / 2 - 0.07 * tall) / ASPECT
    return np.array([[focal, 0, centre[0]], [0, focal / ASPECT, centre[1]], [0, 0, 1]])


def pivot_c(pivot_m: np.ndarray) -> np.ndarray:
    """The pivot in frame C, mm. pivot_m: in the face's own axes."""
    world = TURN @ pivot_m + PLACE
    return FRAME_C @ CAMERA.T @ (world - CAMERA_PLACE) * 1000


def pixels(points_c: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    seen = points_c @ matrix.T
    return seen[..., :2] / seen[..., 2:]


def post_px(width: int, height: int, rows: np.ndarray) -> np.ndarray:
    """Where the middle of the post is in these rows of the image, pixels."""
    ends = np.array([(0.41, -0.9, 1.0), (0.41, -0.9, 2.0)])
    low, high = pixels((ends - CAMERA_PLACE) @ CAMERA @ FRAME_C, camera_matrix(width, height))
    along: np.ndarray = (rows - low[1]) / (high[1] - low[1])
    return low[0] + along * (high[0] - low[0])

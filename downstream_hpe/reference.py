# SPDX-License-Identifier: MIT
"""A frontal face to fit landmarks to: read from a file, or the mean of a training set."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.normalise import ORIGIN, POINTS, normalise
from downstream_hpe.tables import Rows

FOREHEAD, CHIN = 10, 152
NEAR_FRONTAL_DEG = 15.0


def mean_face(rows: Rows) -> np.ndarray:
    """The mean near-frontal face of a training set, levelled: every row is turned back by its R_C.

    Rows within 15° of the front count, every head the same. float64 [468, 3], frame C, RMS 1.

    Raises
    ------
    DataError: no row within 15° of the front.
    """
    near = np.abs(rows.ypr_deg).max(axis=1) <= NEAR_FRONTAL_DEG
    if not near.any():
        raise DataError("no row within 15° of the front, so no mean face; give a reference face")
    chosen = rows.take(near)
    level = normalise(chosen.landmarks.astype(np.float64)) @ chosen.rotation  # rows x^T R = (R^T x)^T
    heads = [level[chosen.heads == head].mean(axis=0) for head in np.unique(chosen.heads)]
    return normalise(np.mean(heads, axis=0))


def load_reference(path: Path | str) -> np.ndarray:
    """A reference face from a file.

    path: .npz with one array, or .csv of x,y,z lines without a header; 468 points in MediaPipe's
    order, looking straight ahead, any unit; frame C (y down, z away from the camera) or frame U (y up,
    z towards the viewer), told apart by where chin and nose are.

    Raises
    ------
    DataError: not readable, another shape, or another frame.
    """
    file = Path(path)
    try:
        if file.suffix == ".npz":
            with np.load(file, allow_pickle=False) as arrays:
                names = list(arrays)
                if len(names) != 1:
                    raise DataError(f"{file}: {len(names)} arrays, expected one of shape [468, 3]")
                points = np.asarray(arrays[names[0]], dtype=np.float64)
        elif file.suffix == ".csv":
            points = np.loadtxt(file, delimiter=",", dtype=np.float64)
        else:
            raise DataError(f"{file}: expected a .npz or .csv file")
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: not readable as a reference face ({str(error).splitlines()[0]})") from error
    if points.shape != (POINTS, 3) or not np.isfinite(points).all():
        raise DataError(f"{file}: expected 468 finite points of x, y, z, got shape {points.shape}")
    down, front = points[CHIN, 1] > points[FOREHEAD, 1], points[ORIGIN, 2] < points[:, 2].mean()
    if down != front:
        raise DataError(
            f"{file}: a mirrored face; expected y down and z away, or y up and z towards the viewer"
        )
    return normalise(points if down else points * [1.0, -1.0, -1.0])

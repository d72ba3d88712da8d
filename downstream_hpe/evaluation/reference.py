# SPDX-License-Identifier: MIT
"""A frontal face to fit landmarks to: read from a file, or the mean of a training set."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.archive import read_npz
from downstream_hpe.geometry.face_mesh import CHIN, FOREHEAD, NOSE_TIP, POINTS
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.reading import MAX_TEXT_BYTES, read_limited
from downstream_hpe.tables.rows import Rows


def mean_face(rows: Rows) -> np.ndarray:
    """The mean face of a training set, levelled: every row is turned back by its R_C.

    All poses count, since a detector's depth leans most at the front: the mean of near-frontal faces
    alone makes a worse reference. Every head counts the same; partial faces do not. float64 [468, 3], frame
    C, RMS 1.
    """
    rows = rows.take(rows.complete)
    level = normalise(rows.landmarks.astype(np.float64)) @ rows.rotation  # rows x^T R = (R^T x)^T
    heads = [level[rows.heads == head].mean(axis=0) for head in np.unique(rows.heads)]
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
            arrays = read_npz(file)
            if len(arrays) != 1:
                raise DataError(f"{file}: {len(arrays)} arrays, expected one of shape [{POINTS}, 3]")
            points = np.asarray(next(iter(arrays.values())), dtype=np.float64)
        elif file.suffix == ".csv":
            text = read_limited(file, MAX_TEXT_BYTES).decode("utf-8")
            points = np.loadtxt(text.splitlines(), delimiter=",", dtype=np.float64)
        else:
            raise DataError(f"{file}: expected a .npz or .csv file")
    except (OSError, ValueError, TypeError) as error:
        why = " ".join(str(error).split())[:200]
        raise DataError(f"{file}: not readable as a reference face ({why})") from error
    if points.shape != (POINTS, 3) or not np.isfinite(points).all():
        raise DataError(f"{file}: expected {POINTS} finite points of x, y, z, got shape {points.shape}")
    down, front = points[CHIN, 1] > points[FOREHEAD, 1], points[NOSE_TIP, 2] < points[:, 2].mean()
    if down != front:
        raise DataError(
            f"{file}: a mirrored face; expected y down and z away, or y up and z towards the viewer"
        )
    return normalise(points if down else points * [1.0, -1.0, -1.0])

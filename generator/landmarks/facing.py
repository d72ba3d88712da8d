# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head looks, as its anchors say: it levels a head, and a recorded levelling is held against it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, geodesic_deg, graphics_rotation
from generator.landmarks.topology import Topology

FEWEST_SHARE = 0.427
"""Of a topology's points: fewer anchors are no face to level. 200 of Face Mesh's."""

AGREES_DEG = 1e-4
"""How near a recorded correction must be to the fit it came from: it has nine decimals."""


def facing(points: np.ndarray, topology: Topology) -> np.ndarray | None:
    """R_C [3, 3] from the mean face to a head's anchors; None with too few of them.

    points: float [P, 3], frame C, NaN where absent.
    """
    known = np.isfinite(points).all(axis=1)
    if known.sum() < FEWEST_SHARE * topology.count:
        return None
    return fit_similarity((topology.surface_face() @ CAMERA_FROM_GRAPHICS)[known], points[known]).rotation


def levelling_problem(
    frame: str,
    correction: Sequence[float],
    sd_deg: Sequence[float],
    heads: Iterable[np.ndarray],
    topology: Topology,
) -> str:
    """What is wrong with a subject's recorded correction, or "".

    It is a rotation, and it is what levels one of the subject's heads: the first that showed a face.

    Parameters
    ----------
    frame, correction, sd_deg: as in heads.parquet; sd_deg is NaN where nothing could be levelled.
    heads: float [P, 3] each, the anchors of the subject's heads in frame C, about the pivot, in
        the mesh's own axes.
    """
    matrix = np.asarray(correction, dtype=np.float64).reshape(3, 3)
    if not (np.abs(matrix @ matrix.T - np.eye(3)) <= 1e-7).all() or np.linalg.det(matrix) < 0:
        return "its correction is no rotation"
    fits = [fit for points in heads if (fit := facing(points, topology)) is not None]
    levelled = bool(np.isfinite(sd_deg).all())
    if not levelled:
        if frame == "canonical" and fits:
            return "its pose zero is canonical, but it was never levelled"
        return "" if (matrix == np.eye(3)).all() else "it has a correction, but was never levelled"
    if not fits:
        return "it has a correction, but too few anchors to have been levelled"
    off = min(float(geodesic_deg(graphics_rotation(fit.T), matrix)) for fit in fits)
    if off > AGREES_DEG:
        return f"its correction is {off:.3g} degrees from what its anchors say"
    return ""

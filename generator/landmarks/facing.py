# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head looks, as its anchors say: it levels a head, and a recorded levelling is held against it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import (
    CAMERA_FROM_GRAPHICS,
    geodesic_deg,
    graphics_rotation,
    rotation_from_angles,
)
from generator.landmarks.topology import Topology

FEWEST_SHARE = 0.427
"""Of a topology's points: fewer anchors are no face to level. 200 of Face Mesh's."""

PLAUSIBLE_DEG = 18.0
"""How near a correction must be to what the shape of the face alone says: faces differ by 3 degrees of pitch,
a standard deviation, and a detector leans by 5."""

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


def detected_facing(landmarks: np.ndarray, topology: Topology) -> np.ndarray:
    """R_C [3, 3] that the rigid fit of the detector's own model face to its landmarks reads.

    landmarks: float [P, 3], as a detector gives them. The fit is to the reference face, of which is known
    how the model face reads it: over photographs the two ways differ by 0.02 degrees of pitch, sd 0.04
    (scripts/make_anchors.py --model prints it for heads of ours).
    """
    reference = topology.reference_face() @ CAMERA_FROM_GRAPHICS
    read = rotation_from_angles(np.array([0.0, topology.level_pitch_deg, 0.0]))
    return fit_similarity(reference, np.asarray(landmarks, dtype=np.float64)).rotation @ read


def levelling_problem(
    frame: str,
    correction: Sequence[float],
    sd_deg: Sequence[float],
    heads: Iterable[np.ndarray],
    topology: Topology,
    packaged: Iterable[Callable[[np.ndarray], np.ndarray]] = (),
) -> str:
    """What is wrong with a subject's recorded correction, or "".

    It is a rotation, and it is what levels one of the subject's heads: the first that showed a face. In
    frame "canonical" that is known to the last digit; otherwise it rests on what a detector said, and is
    what the anchors say to PLAUSIBLE_DEG.

    Parameters
    ----------
    frame, correction, sd_deg: as in heads.parquet; sd_deg is NaN where nothing could be levelled.
    heads: float [P, 3] each, the anchors of the subject's heads in frame C, about the pivot, in
        the mesh's own axes.
    packaged: for heads whose anchors come with the package: what their correction must be, R_U [3, 3], by
        their anchors; one of them.
    """
    matrix = np.asarray(correction, dtype=np.float64).reshape(3, 3)
    if not (np.abs(matrix @ matrix.T - np.eye(3)) <= 1e-7).all() or np.linalg.det(matrix) < 0:
        return "its correction is no rotation"
    faces = [points for points in heads if facing(points, topology) is not None]
    if not np.isfinite(sd_deg).all():
        if frame != "source" and faces:
            return f"its pose zero is {frame}, but it was never levelled"
        return "" if (matrix == np.eye(3)).all() else "it has a correction, but was never levelled"
    if not faces:
        return "it has a correction, but too few anchors to have been levelled"
    fits = [graphics_rotation(fit.T) for points in faces if (fit := facing(points, topology)) is not None]
    allowed = AGREES_DEG if frame == "canonical" else PLAUSIBLE_DEG
    if (known := list(packaged)) and frame != "canonical":
        fits, allowed = [correct(points) for points in faces for correct in known], AGREES_DEG
    off = min(float(geodesic_deg(fit, matrix)) for fit in fits)
    if off > allowed:
        return f"its correction is {off:.3g} degrees from what its anchors say"
    return ""

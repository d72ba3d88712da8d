# SPDX-License-Identifier: MIT
"""From an estimator's zero to the labels': raw, without a constant rotation, and what the labels' own
points say of their zero."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from downstream_hpe.evaluation.constant import Constant, constant
from downstream_hpe.evaluation.scored_rows import Measured
from downstream_hpe.evaluation.scores import Evaluation, evaluate
from downstream_hpe.geometry.face_mesh import IBUG_INNER
from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation

OWN_POINTS = "rigid fit of the labels' own points"
LEAST_POINTS = 4
"""Fewer say little of a rotation."""


def label_frames(
    found: Sequence[Evaluation], measured: Measured, reference: np.ndarray | None, folds: int
) -> list[tuple[Evaluation, Constant]]:
    """Every estimator beside the constant between its zero and the labels'; last, with a reference face
    [468, 3] and labels that have points of their own, the fit of that face to these.

    found: of measured's rows, in their order.
    """
    rows = measured.rows
    every = list(found)
    subjects = [rows.subjects] * len(every)
    rotation = [rows.rotation] * len(every)
    if reference is not None and measured.own_points is not None:
        known = np.isfinite(measured.own_points).all(axis=2).sum(axis=1) >= LEAST_POINTS
        fitted = own_points_fit(reference, measured.own_points[known])
        if fitted is not None:
            every.append(evaluate(OWN_POINTS, fitted, rows.rotation[known]))
            subjects.append(rows.subjects[known])
            rotation.append(rows.rotation[known])
    return [
        (e, constant(e.predicted_deg, true, names, folds))
        for e, true, names in zip(every, rotation, subjects, strict=True)
        if e.count > 1
    ]


def own_points_fit(reference: np.ndarray, points: np.ndarray) -> np.ndarray | None:
    """Angles of the rigid fit of a face [468, 3] to the points that labels themselves place, float64 [N, 3].

    No detector is in it: what it is off by is how the two faces differ, and where their zeros lie.
    points: float [N, 468, 3], or iBUG's 68, of which the inner 51 count; those that every row has are used.
    None: they are fewer than LEAST_POINTS, or there is no row.
    """
    if points.shape[1] != len(reference):
        points, reference = points[:, -len(IBUG_INNER) :], reference[list(IBUG_INNER)]
    there = np.isfinite(points).all(axis=(0, 2))
    if not len(points) or there.sum() < LEAST_POINTS:
        return None
    return angles_from_rotation(fit_rotation(reference[there], points[:, there].astype(np.float64)))

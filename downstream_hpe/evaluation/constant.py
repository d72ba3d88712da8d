# SPDX-License-Identifier: MIT
"""The constant rotation between an estimator's pose zero and that of the labels, and errors without it.

Two sets may count angles from zeros a few degrees apart, and no method that has not seen their labels can
know. With R_estimate = R_true C, C is that offset, a turn of the head about its own axes. It is found on
some subjects and taken out on others, so that taking it out teaches nothing of the faces it is measured on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from downstream_hpe import escape
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.scores import Evaluation
from downstream_hpe.geometry.metrics import euler_errors, geodesic_errors
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles

FOLDS = 5
RESAMPLED = 400
"""Draws of subjects, with replacement, for an interval."""


@dataclass(frozen=True)
class Constant:
    """ypr_deg: C of all rows, float64 [3]: the pose that the estimator gives a face at the labels' zero, so
    a positive pitch is one that it reads too high. interval_deg: float64 [2, 3], 95 % of it over subjects
    drawn anew; NaN with a single one. mae [3] and geodesic: what is left without it, cross-validated over
    folds of whole subjects."""

    ypr_deg: np.ndarray
    interval_deg: np.ndarray
    mae: tuple[float, float, float]
    geodesic: float
    folds: int

    @property
    def mean_mae(self) -> float:
        """The mean of the three angles'."""
        return float(np.mean(self.mae))


def constant(
    predicted_deg: np.ndarray, true: np.ndarray, subjects: np.ndarray, folds: int = FOLDS
) -> Constant:
    """Of estimates, float [N, 3], beside the true R_C, float [N, 3, 3]. subjects: str [N].

    Raises
    ------
    DataError: fewer than two rows, or folds.
    """
    if len(true) < 2 or folds < 2:
        raise DataError(f"{len(true)} rows and {folds} folds: no constant can be taken out of fewer than two")
    predicted = rotation_from_angles(predicted_deg)
    between = np.swapaxes(true, 1, 2) @ predicted
    fold = folds_of(subjects, folds)
    corrected = np.empty_like(predicted)
    for k in np.unique(fold):
        corrected[fold == k] = predicted[fold == k] @ _mean_rotation(between[fold != k].sum(axis=0)).T
    errors = euler_errors(angles_from_rotation(corrected), angles_from_rotation(true)).mean(axis=0)
    whole = angles_from_rotation(_mean_rotation(between.sum(axis=0)))
    return Constant(
        whole,
        _interval(between, subjects),
        tuple(errors.tolist()),
        float(geodesic_errors(corrected, true).mean()),
        len(np.unique(fold)),
    )


def folds_of(subjects: np.ndarray, folds: int) -> np.ndarray:
    """The fold of each row, int [N]: subjects dealt out in order; never one in two folds.

    Rows of a single subject, such as a packed file that names none, are cut into runs, since neighbours
    may be frames of one video.
    """
    names, place = np.unique(subjects, return_inverse=True)
    if len(names) == 1:
        return np.arange(len(subjects)) * min(folds, len(subjects)) // len(subjects)
    return place % folds


def _interval(between: np.ndarray, subjects: np.ndarray) -> np.ndarray:
    names, place = np.unique(subjects, return_inverse=True)
    if len(names) == 1:
        return np.full((2, 3), np.nan)
    sums = np.zeros((len(names), 9))
    np.add.at(sums, place, between.reshape(-1, 9))
    drawn = np.random.default_rng(0).multinomial(len(names), np.full(len(names), 1 / len(names)), RESAMPLED)
    means = _mean_rotation((drawn @ sums).reshape(-1, 3, 3))
    return np.percentile(angles_from_rotation(means), [2.5, 97.5], axis=0)


def _mean_rotation(total: np.ndarray) -> np.ndarray:
    """The rotation nearest to all whose sum is given, in the chordal distance: [..., 3, 3].

    Hartley, Trumpf, Dai and Li, "Rotation averaging", IJCV 103, 2013, section 5.3.
    """
    u, _, vt = np.linalg.svd(total)
    sign = np.ones(total.shape[:-1])
    sign[..., 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return (u * sign[..., None, :]) @ vt


def markdown(found: Sequence[tuple[Evaluation, Constant]]) -> str:
    """A row an estimator: raw, the constant between its zero and the labels', and what is left without it."""
    folds = found[0][1].folds
    lines = [
        f"| zero of | rows | MAE | geodesic | constant yaw | pitch | roll | MAE without, {folds} folds "
        "| geodesic without |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for e, c in found:
        spans = zip(c.ypr_deg, *c.interval_deg, strict=True)
        said = " | ".join(
            f"{value:+.1f}" + (f" ({low:+.1f} to {high:+.1f})" if np.isfinite(low) else "")
            for value, low, high in spans
        )
        lines.append(
            f"| {escape.markdown(e.name)} | {e.count} | {e.mean_mae:.2f} | {e.geodesic:.2f} | {said} "
            f"| {c.mean_mae:.2f} | {c.geodesic:.2f} |"
        )
    return "\n".join(lines) + "\n"


def summary(c: Constant) -> dict[str, Any]:
    """The numbers for machines; an interval that there is none of is null."""
    known = bool(np.isfinite(c.interval_deg).all())
    return {
        "constant_deg": c.ypr_deg.tolist(),
        "constant_interval_deg": c.interval_deg.tolist() if known else None,
        "mae_without_constant": c.mean_mae,
        "geodesic_without_constant": c.geodesic,
    }

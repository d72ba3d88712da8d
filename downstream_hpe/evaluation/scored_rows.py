# SPDX-License-Identifier: MIT
"""Which rows `downstream-hpe evaluate` scores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.evaluation.photographs import FORMATS, LeftOut, detected_rows
from downstream_hpe.geometry.partial import LEAST_POINTS
from downstream_hpe.prediction.kinds import MEDIA
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.tables.pose_zero import MANIFEST, pose_zero
from downstream_hpe.tables.rows import Rows, read_exact, read_missed, read_rows

Note = Callable[[str], None]


@dataclass(frozen=True)
class Measured:
    """rows: with a face. missed_deg: float64 [M, 3], (yaw, pitch, roll) of those without one. damaged: how
    many more could not be read. own_points: of the rows, where the labels themselves place them, frame C:
    float [N, 468, 3], or iBUG's [N, 68, 3]; NaN where there are none, None where no row has any."""

    rows: Rows
    missed_deg: np.ndarray
    damaged: int = 0
    own_points: np.ndarray | None = None


def dataset_rows(
    predictor: Predictor, dataset: Path | str, split: str | None, note: Note, partial: bool = False
) -> Measured:
    """The rows of a dataset whose subjects the model was not trained on.

    partial: instead those on which no face was found, as :func:`read_rows` makes partial faces of them.

    Raises
    ------
    UsageError: pictures instead of tables. DataError: no such rows.
    """
    _expect_tables(Path(dataset))
    rows = read_rows(dataset, split, partial)
    subjects, missed_deg = read_missed(dataset, split)
    if partial:
        if rows.undetected:
            note(f"{rows.undetected} rows left out: the camera sees fewer than {LEAST_POINTS} landmarks")
        rows, subjects, missed_deg = rows.take(~rows.complete), subjects[:0], missed_deg[:0]
        if not len(rows):
            raise DataError(f"{dataset}: a face was found in every row; leave out --partial")
    theirs = pose_zero(dataset)
    if theirs and predictor.pose_zero and theirs != predictor.pose_zero:
        note(
            f"{dataset} counts angles with --frame {theirs}, the model with {predictor.pose_zero}: "
            "a constant difference a head is to be expected, mostly in pitch"
        )
    trained = sorted(predictor.trained_subjects)
    unseen = ~np.isin(rows.subjects, trained)
    if not unseen.any():
        raise DataError(f"{dataset}: the model was trained on every subject in it; give other heads")
    if not unseen.all():
        note(f"{len(np.unique(rows.subjects[~unseen]))} subjects the model was trained on left out")
    own = None if partial else read_exact(dataset, split)
    return Measured(
        rows.take(unseen),
        missed_deg[~np.isin(subjects, trained)],
        own_points=None if own is None else own[unseen],
    )


def photograph_rows(predictor: Predictor, path: Path, layout: str, note: Note) -> Measured:
    """The labelled photographs of a folder or file in which the labelled face is found.

    layout: a key of :data:`downstream_hpe.evaluation.photographs.FORMATS`.

    Raises
    ------
    DataError: as the format's loader; no face found.
    """
    left_out = LeftOut()
    try:
        rows, missed_deg, own = detected_rows(FORMATS[layout](path, left_out), predictor.faces)
    finally:
        # Also where nothing is left, for they say why.
        for line in left_out.damaged:
            note(f"{line}; left out")
        for reason, count in left_out.filtered.items():
            note(f"{count} photographs left out: {reason}")
    return Measured(rows, missed_deg, len(left_out.damaged), own if np.isfinite(own).any() else None)


def _expect_tables(path: Path) -> None:
    """UsageError where there are pictures and no tables. What else is wrong the reader of tables says."""
    if (path / MANIFEST).is_file():
        return  # beside its tables a dataset may hold millions of pictures, not to be listed
    below = path.rglob("*") if path.is_dir() else [path]
    suffixes = {file.suffix.lower() for file in below}
    if suffixes & (MEDIA | {".mat", ".npz"}) and ".parquet" not in suffixes:
        raise UsageError(
            f"{path}: no dataset; evaluate takes a folder or .parquet of headturn build or, with --format "
            "aflw2000, biwi or biwi-npz, labelled photographs; for others there is downstream-hpe predict"
        )

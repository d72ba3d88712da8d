# SPDX-License-Identifier: MIT
"""Which subjects are learned from, and which are held out; never images of one subject on both sides."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.tables.columns import column
from downstream_hpe.tables.open import open_tables


def subjects_by_split(path: Path | str) -> dict[str, set[str]]:
    """The subjects of each split.

    Raises
    ------
    DataError: as :func:`open_tables`; a subject in two splits, which would test on a trained face.
    """
    columns = ["subject", "split"]
    tables = open_tables(path, columns)
    splits: dict[str, set[str]] = {}
    for batch in tables.batches(columns):
        for subject, split in set(zip(*(column(batch, name) for name in columns), strict=True)):
            splits.setdefault(split, set()).add(subject)
    seen: dict[str, str] = {}
    for split, subjects in splits.items():
        for subject in subjects:
            if subject in seen:
                raise DataError(f"{tables.path}: {subject} is in the splits {seen[subject]!r} and {split!r}")
            seen[subject] = split
    return splits


def split_subjects(subjects: np.ndarray, share: float, seed: int = 0) -> np.ndarray:
    """Rows held out for validation: bool [N], all rows of a subject together.

    The subjects with the smallest hashes are held out, so that adding heads never moves another one
    across more than the edge. At least one subject stays on either side.

    Raises
    ------
    DataError: one subject only, or a share outside (0, 1).
    """
    names = np.unique(subjects)
    if len(names) < 2 or not 0 < share < 1:
        raise DataError(
            f"cannot hold out {share:g} of {len(names)} subjects; expected two or more and 0 < share < 1"
        )
    order = sorted(names, key=lambda name: hashlib.sha256(f"{seed}/{name}".encode()).digest())
    count = min(max(round(share * len(names)), 1), len(names) - 1)
    return np.isin(subjects, order[:count])

# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems of rows, each with the row's name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyarrow as pa


def named(batch: pa.RecordBatch, wrong: np.ndarray, what: str) -> Iterator[str]:
    """One problem a row that is wrong, with its sample_id. wrong: bool [N]."""
    if wrong.any():
        names = batch.column("sample_id")
        for row in np.flatnonzero(wrong).tolist():
            yield f"{names[row].as_py()}: {what}"

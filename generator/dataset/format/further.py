# SPDX-License-Identifier: GPL-3.0-or-later
"""Further detectors of a dataset: a column of landmarks each, beside those of the first."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import FURTHER, further_column, to_arrow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import as_array
from generator.plan.settings import Landmarks

Rows = TypeVar("Rows", pa.RecordBatch, pa.Table)


def also_of(manifest: Manifest) -> tuple[str, ...]:
    """Names of a dataset's further detectors, as far as we know them."""
    section = manifest.configuration.get("landmarks", {})
    names = section.get("also", ()) if isinstance(section, dict) else ()
    listed = names if isinstance(names, (list, tuple)) else ()
    known = (name for name in listed if isinstance(name, str) and further_column(name) in FURTHER)
    return tuple(dict.fromkeys(known))


def first_of(manifest: Manifest) -> str:
    """The name of the detector of the columns "detected" and "landmarks"."""
    section = manifest.configuration.get("landmarks", {})
    return str(section.get("detector", Landmarks.detector)) if isinstance(section, dict) else ""


def seen_by(rows: Rows, detector: str) -> Rows:
    """Rows as if a further detector had been the first: its landmarks, and where it found a face.

    rows: with its column, "landmarks" and "detected".
    """
    landmarks = as_array(rows, further_column(detector))
    values = {
        "landmarks": rows.column(further_column(detector)),
        "detected": to_arrow(np.isfinite(landmarks).all(axis=(1, 2)), pa.bool_()),
    }
    for name, column in values.items():
        rows = rows.set_column(rows.schema.get_field_index(name), rows.schema.field(name), column)
    return rows

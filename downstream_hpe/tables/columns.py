# SPDX-License-Identifier: MIT
"""Columns of one batch of rows as arrays, and what must hold of every row."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.rotation import ANGLES, rotation_from_angles

ROTATION = "Rx(-pitch) Ry(yaw) Rz(roll)"

ANGLE_COLUMNS = tuple(f"{angle}_deg" for angle in ANGLES)
INDEX_COLUMNS = tuple(f"{angle}_index" for angle in ANGLES)
HEAD_COLUMNS = ("subject", "expression")
WORN = ("mask", "occluder", "glasses", "beard", "headwear", "headphones")
"""What heads wear, and is before them: columns ``look_...``, whose values are styles."""
_TEXTS = {*HEAD_COLUMNS, "split", "projection", "image_path", *(f"look_{kind}" for kind in WORN)}
_FLAGS = {"landmarks_visible"}
_LISTS = {"rotation", "landmarks", "landmarks_exact", "camera", "translation_mm"}


def check_columns(where: str, schema: pa.Schema, names: Sequence[str], otherwise: str) -> None:
    """DataError if a column is not there, or not of its kind. otherwise: what is expected, or to be done."""
    for name in names:
        if name not in schema.names:
            raise DataError(f"{where}: no column {name}; {otherwise}")
        if schema.names.count(name) > 1:
            raise DataError(f"{where}: two columns {name}; {otherwise}")
        if not _is_of_its_kind(name, schema.field(name).type):
            raise DataError(f"{where}: the column {name} holds {schema.field(name).type}; {otherwise}")


def _is_of_its_kind(name: str, kind: pa.DataType) -> bool:
    if name in _TEXTS:
        kind = kind.value_type if pa.types.is_dictionary(kind) else kind
        return pa.types.is_string(kind) or pa.types.is_large_string(kind)
    if name in _LISTS | _FLAGS:
        lists = (pa.types.is_fixed_size_list, pa.types.is_list, pa.types.is_large_list)
        of = pa.types.is_boolean if name in _FLAGS else pa.types.is_floating
        return any(is_one(kind) for is_one in lists) and bool(of(kind.value_type))
    if name in INDEX_COLUMNS:
        return pa.types.is_integer(kind)
    return pa.types.is_boolean(kind) if name == "detected" else pa.types.is_floating(kind)


def column(batch: pa.RecordBatch, name: str) -> np.ndarray:
    """One column of scalars: [N]. DataError if a value is null."""
    values = batch.column(name)
    if values.null_count:
        raise DataError(f"column {name} has {values.null_count} nulls; a table of headturn build has none")
    return values.to_numpy(zero_copy_only=False)


def vectors(batch: pa.RecordBatch, name: str, size: int) -> np.ndarray:
    """One column of fixed-size lists: [N, size]. DataError if a list has another length."""
    values = batch.column(name).flatten()
    if len(values) != len(batch) * size or values.null_count:
        raise DataError(f"column {name}: expected {size} numbers a row")
    return values.to_numpy(zero_copy_only=False).reshape(-1, size)


def angles_of(batch: pa.RecordBatch) -> np.ndarray:
    """(yaw, pitch, roll) in degrees, float64 [N, 3]."""
    return np.stack([column(batch, name) for name in ANGLE_COLUMNS], axis=-1)


def landmarks_of(batch: pa.RecordBatch) -> np.ndarray:
    """float32 [N, 468, 3], isotropic pixels, frame C; NaN where not detected."""
    return vectors(batch, "landmarks", 3 * POINTS).reshape(-1, POINTS, 3)


def check_rows(where: Path, batch: pa.RecordBatch) -> None:
    """DataError unless rotations are those of the angles and detected landmarks are finite."""
    wrong = ~np.isfinite(landmarks_of(batch)).all(axis=(1, 2)) & column(batch, "detected")
    if wrong.any():
        raise DataError(f"{where}: {_row(batch, wrong)} is detected but its landmarks are not finite")
    expected = rotation_from_angles(angles_of(batch)).reshape(-1, 9)
    wrong = ~(np.abs(vectors(batch, "rotation", 9) - expected).max(axis=1) < 1e-6)
    if wrong.any():
        raise DataError(f"{where}: rotation of {_row(batch, wrong)} is not {ROTATION} of its angles")


def _row(batch: pa.RecordBatch, wrong: np.ndarray) -> str:
    first = int(np.argmax(wrong))
    row = {name: batch.column(name)[first].as_py() for name in (*HEAD_COLUMNS, *ANGLE_COLUMNS)}
    head = f"{row['subject']}/{row['expression']}"
    return cell_name(head, (row["yaw_deg"], row["pitch_deg"], row["roll_deg"]))


def cell_name(head: str, ypr_deg: Sequence[float]) -> str:
    """How messages name one row."""
    return f"{head} at yaw {ypr_deg[0]:g}, pitch {ypr_deg[1]:g}, roll {ypr_deg[2]:g}"

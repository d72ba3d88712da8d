# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of a dataset as arrays, and the images of its rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds

from generator.dataset.format.manifest import Manifest
from generator.dataset.format.part import BATCH, PartInfo
from generator.dataset.format.schema import LANDMARK_COLUMNS
from generator.errors import DatasetError

OPEN_PARTS = 64


def read_rows(
    root: Path,
    parts: Sequence[PartInfo],
    columns: list[str] | None = None,
    where: pc.Expression | None = None,
) -> Iterator[pa.RecordBatch]:
    """The rows of some parts, batch by batch: only some columns, only those that fulfil where.

    Raises DatasetError: a part is missing or damaged.
    """
    try:
        # A dataset keeps the footers of all its files, 100 kB each, so it is opened piece by piece.
        for start in range(0, len(parts), OPEN_PARTS):
            paths = [str(root / part.path) for part in parts[start : start + OPEN_PARTS]]
            data = ds.dataset(paths, format="parquet")
            yield from data.to_batches(columns=columns, filter=where, batch_size=BATCH)
    except (OSError, pa.ArrowException) as error:
        # The whole message on one line: its first sentence does not name the file.
        what = " ".join(str(error).split())
        raise DatasetError(f"{root}: {what}; `headturn verify` says what is wrong") from error


def as_array(table: pa.Table | pa.RecordBatch, name: str) -> np.ndarray:
    """A column as numpy: [N] of its type, [N, k] for a list, landmarks as [N, 468, 3], text as objects."""
    column = table.column(name)
    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    if not pa.types.is_fixed_size_list(column.type):
        return column.to_numpy(zero_copy_only=False)
    shape = (-1, 3) if name in LANDMARK_COLUMNS else (column.type.list_size,)
    return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), *shape)


def read_samples(root: Path, manifest: Manifest, sample_ids: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The rows of some samples by their sample_id; those that are not there are left out.

    Reads only the parts of their heads. Raises DatasetError: a part is missing or damaged.
    """
    heads = {tuple(name.split("/")[:2]) for name in sample_ids}
    parts = [p for p in manifest.parts if not p.subject or (p.subject, p.expression) in heads]
    found: dict[str, dict[str, Any]] = {}
    for batch in read_rows(root, parts, where=pc.field("sample_id").isin(list(sample_ids))):
        found.update((row["sample_id"], row) for row in batch.to_pylist())
    return found


def image_bytes(root: Path, row: Mapping[str, Any]) -> bytes:
    """The encoded image of one row, from the table or from its file.

    Raises DatasetError: the dataset was built without images, or the file is gone.
    """
    if row.get("image"):
        return row["image"]["bytes"]
    if not row["image_path"]:
        raise DatasetError(f"{root}: built with images = none; build with files or embedded to see them")
    path = root / row["image_path"]
    try:
        return path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read ({error.strerror}); see `headturn verify`") from error

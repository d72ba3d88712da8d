# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of a dataset as arrays, and the images of its rows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds

from generator.dataset.format.columns import EVERY
from generator.dataset.format.defaults import todays_schema, with_defaults
from generator.dataset.format.files import one_line
from generator.dataset.format.guard import check_texts, dataset_file
from generator.dataset.format.image import image_format, read_image
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.parquet import batch_rows, open_parquet
from generator.dataset.format.part import BATCH, part_schema_of
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import topology_of
from generator.errors import DatasetError
from generator.escape import printable
from generator.landmarks.topology import FACE_MESH, Topology
from generator.plan.factors import is_twin

OPEN_PARTS = 64

IMAGE_FACTS = ["image_path", "image_sha256"]
"""Columns of :func:`proven_image`, besides image where it is in the table."""


def read_rows(
    root: Path,
    parts: Sequence[PartInfo],
    columns: list[str] | None = None,
    where: pc.Expression | None = None,
) -> Iterator[pa.RecordBatch]:
    """The rows of some parts, batch by batch: only some columns, only those that fulfil where.

    Columns that older parts lack hold their defaults; where is about columns of schema 1.0.
    Raises DatasetError: a part is missing or damaged.
    """
    try:
        # A dataset keeps the footers of all its files, 100 kB each, so it is opened piece by piece.
        for start in range(0, len(parts), OPEN_PARTS):
            files = [dataset_file(root, part.path) for part in parts[start : start + OPEN_PARTS]]
            scan, paths = _scan_options(files), [str(file) for file in files]
            data = ds.dataset(paths, format="parquet")
            where_from = paths[0] if len(paths) == 1 else root
            today = todays_schema(data.schema, paths[0])
            if set(columns or today.names) <= set(data.schema.names):
                for batch in data.to_batches(columns=columns, filter=where, **scan):
                    check_texts(batch, where_from)
                    yield batch
                continue
            stored = [name for name in columns or today.names if name in data.schema.names]
            # Without any column a batch would not know how long it is.
            for batch in data.to_batches(columns=stored or ["sample_id"], filter=where, **scan):
                check_texts(batch, where_from)
                yield with_defaults(batch, today, columns or today.names)
    except (OSError, pa.ArrowException, KeyError) as error:
        # The whole message on one line: its first sentence does not name the file.
        what = " ".join(str(error).split())
        raise DatasetError(f"{root}: {what}; `headturn verify` says what is wrong") from error


def _scan_options(paths: Sequence[Path]) -> dict[str, int]:
    """How many rows of these parts are read at once, and ahead. Raises as read_rows does."""
    most = BATCH
    for path in paths:
        try:
            with open_parquet(path) as file:
                most = min(most, batch_rows(file.metadata, BATCH))
        except ValueError as error:
            raise DatasetError(f"{path}: {one_line(error)}; `headturn verify` says what is wrong") from error
    return {"batch_size": most} if most == BATCH else {"batch_size": most, "batch_readahead": 0}


def dataset_topology(root: Path, manifest: Manifest) -> Topology:
    """What the landmarks of a dataset are: its first readable part says it; Face Mesh if none can be read.

    Raises DatasetError if no registered topology has that name.
    """
    for part in manifest.parts:
        try:
            schema = part_schema_of(root / part.path)
        except DatasetError:
            continue  # whoever reads its rows says what is wrong with it
        return topology_of(schema, str(root / part.path))
    return FACE_MESH


def as_array(table: pa.Table | pa.RecordBatch, name: str) -> np.ndarray:
    """A column as numpy: [N] of its type, [N, k] for a list, landmarks as [N, P, 3], text as objects."""
    column = table.column(name)
    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    if not pa.types.is_fixed_size_list(column.type):
        return column.to_numpy(zero_copy_only=False)
    values = EVERY[name].values_a_point if name in EVERY else 0
    size = column.type.list_size
    shape = (size // values, values) if values > 1 else (size,)  # numpy finds no side of no rows
    return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), *shape)


def read_samples(root: Path, manifest: Manifest, sample_ids: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The rows of some samples by their sample_id; those that are not there are left out.

    Reads only the parts of their heads. Raises DatasetError: a part is missing or damaged.
    """
    heads = {tuple(name.split("/")[:2]) for name in sample_ids}
    found: dict[str, dict[str, Any]] = {}
    for tables in (manifest.parts, manifest.twins if any(map(is_twin, sample_ids)) else ()):
        parts = [p for p in tables if not p.subject or (p.subject, p.expression) in heads]
        for batch in read_rows(root, parts, where=pc.field("sample_id").isin(list(sample_ids))):
            found.update((row["sample_id"], row) for row in batch.to_pylist())
    return found


def image_bytes(root: Path, row: Mapping[str, Any]) -> bytes:
    """The encoded image of one row, from the table or from its file: a PNG or JPEG, by its header.

    Raises DatasetError: as :func:`stored_bytes`, or it is no such image.
    """
    encoded, name = stored_bytes(root, row)
    image_format(encoded, name)
    return encoded


def stored_bytes(root: Path, row: Mapping[str, Any]) -> tuple[bytes, str]:
    """What is stored as the image of one row, whatever it is, and what messages call it.

    Raises DatasetError: the dataset was built without images, or the file is gone or lies elsewhere.
    """
    if row.get("image"):
        return row["image"]["bytes"], f"{root}: an embedded image"
    if not row["image_path"]:
        raise DatasetError(f"{root}: built with images = none; build with files or embedded to see them")
    path = dataset_file(root, row["image_path"])
    return read_image(path), str(path)


def proven_image(root: Path, row: Mapping[str, Any], sample_id: str) -> bytes:
    """As :func:`image_bytes`, and it is the image that was rendered. row: with :data:`IMAGE_FACTS`.

    Raises DatasetError as well if its SHA-256 is not the row's.
    """
    image = image_bytes(root, row)
    if hashlib.sha256(image).hexdigest() != row["image_sha256"]:
        raise DatasetError(
            f"{root}: the image of {printable(sample_id)} is not the one that was rendered (SHA-256 "
            "differs); see `headturn verify`"
        )
    return image

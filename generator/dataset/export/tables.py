# SPDX-License-Identifier: GPL-3.0-or-later
"""The table itself, filtered, with its images inside: what huggingface and croissant share."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa

from generator.dataset.export.sample import suffix_of
from generator.dataset.export.source import Source
from generator.dataset.format.columns import ROWS
from generator.dataset.format.defaults import todays_schema
from generator.dataset.format.heads_table import copy_heads
from generator.dataset.format.open import IMAGE_FACTS, proven_image
from generator.dataset.format.part import part_schema_of, write_table

IMAGE = "image"


def write_tables(source: Source, folder: Path) -> Counter[str]:
    """Write data/<split>/part-*.parquet and heads.parquet; returns the number of rows of each split.

    Raises
    ------
    DatasetError: a part or an image is missing or damaged.
    UsageError: a row was not detected and missing = "fail".
    """
    rows: Counter[str] = Counter()
    schema = exported_schema(source)
    for part in source.parts:
        batches = [_exported(source, batch, schema) for batch in _kept(source, part)]
        if not batches:
            continue
        path = folder / part.path
        path.parent.mkdir(parents=True, exist_ok=True)
        table = pa.Table.from_batches(batches, schema=schema)
        with path.open("wb") as file:
            write_table(table, file)
        rows[part.path.split("/")[1]] += len(table)
    copy_heads(source.root, [(head.subject, head.expression) for head in source.heads], folder)
    return rows


def exported_schema(source: Source) -> pa.Schema:
    """The schema of the parts, with the features of every column in its Hugging Face metadata."""
    original = todays_schema(part_schema_of(source.root / source.parts[0].path))
    stays = {column.name for column in ROWS.values() if column.local} | {IMAGE}
    fields = [field for field in original if field.name not in stays]
    if source.has_images:
        fields.append(ROWS[IMAGE].field(source.topology))
    schema = pa.schema(fields)
    features = {field.name: feature(field) for field in schema}
    metadata = {
        **original.metadata,
        b"headturn.images": b"embedded" if source.has_images else b"none",
        b"huggingface": json.dumps({"info": {"features": features}}).encode(),
    }
    return schema.with_metadata(metadata)


def feature(field: pa.Field) -> dict[str, Any]:
    """The feature of Hugging Face datasets that a column is."""
    if field.name == IMAGE:
        return {"_type": "Image"}
    if pa.types.is_fixed_size_list(field.type):
        inner = feature(field.type.value_field)
        return {"feature": inner, "length": field.type.list_size, "_type": "Sequence"}
    return {"dtype": dtype_name(field.type), "_type": "Value"}


def dtype_name(kind: pa.DataType) -> str:
    """What Hugging Face calls a scalar type."""
    return {"double": "float64", "float": "float32"}.get(str(kind), str(kind))


def _kept(source: Source, part: Any) -> Iterator[pa.RecordBatch]:
    for batch in source.batches([part]):
        kept = source.kept(batch)
        if len(kept):
            yield kept


def _exported(source: Source, batch: pa.RecordBatch, schema: pa.Schema) -> pa.RecordBatch:
    columns = [batch.column(field.name) for field in schema if field.name != IMAGE]
    if source.has_images:
        embedded = source.manifest.images == "embedded"
        images = []
        for name, row in zip(
            batch.column("sample_id").to_pylist(),
            batch.select([*IMAGE_FACTS, *(["image"] if embedded else [])]).to_pylist(),
            strict=True,
        ):
            encoded = proven_image(source.root, row, name)
            suffix = suffix_of(encoded, name)
            images.append({"bytes": encoded, "path": name.replace("/", "_") + suffix})
        columns.append(pa.array(images, schema.field(IMAGE).type))
    return pa.record_batch(columns, schema=schema)

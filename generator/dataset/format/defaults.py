# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of an earlier schema as rows of today's: the columns they lack hold their defaults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import pyarrow as pa

from generator.dataset.format.columns import ROWS, SCHEMA_VERSION, version_number
from generator.dataset.format.schema import is_newer, part_schema, schema_version_of, topology_of

Rows = TypeVar("Rows", pa.RecordBatch, pa.Table)


def todays_schema(stored: pa.Schema, where: str = "the schema") -> pa.Schema:
    """The schema that a reader sees of a part with this one.

    A part of today's schema, or of a later one, is seen as it is stored. An earlier one also has the
    columns that came later, in the order of the table; columns that we do not know come last.
    where: the file, for the message.
    Raises DatasetError: it is older, and no registered topology is that of its landmarks.
    """
    version = schema_version_of(stored)
    later = [c for c in ROWS.values() if is_newer(c.since, version) and c.name not in stored.names]
    if version_number(version) is None or not is_newer(SCHEMA_VERSION, version):
        return stored
    topology = topology_of(stored, where)
    fields = {column.name: column.field(topology) for column in later if column.default is not None}
    fields.update({name: stored.field(name) for name in stored.names})
    names = [name for name in ROWS if name in fields] + [name for name in fields if name not in ROWS]
    today = part_schema("none", {}, "", topology).metadata
    renewed = {key: today[key] for key in (b"headturn.schema_version", b"headturn.conventions")}
    return pa.schema([fields[name] for name in names], metadata={**stored.metadata, **renewed})


def with_defaults(rows: Rows, schema: pa.Schema, columns: Sequence[str] | None = None) -> Rows:
    """Stored rows as :func:`todays_schema` has them, or only some of their columns, in that order."""
    if columns is None and rows.schema.names == schema.names:
        return rows
    fields = [schema.field(name) for name in (schema.names if columns is None else columns)]
    values = [
        rows.column(field.name)
        if field.name in rows.schema.names
        else ROWS[field.name].absent(len(rows), field.type)
        for field in fields
    ]
    return type(rows).from_arrays(values, schema=pa.schema(fields, metadata=schema.metadata))

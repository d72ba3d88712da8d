# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes as a series of choices: who flips them edits a sound document and does not break its form."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa

T = TypeVar("T")

ODD: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 255, 1.5, -0.0, 1e308, float("nan"), float("inf"), 10**26, 2**63,
    -(2**63), 2**31, "", "a", "1", "../a", "/etc/passwd", "a/b", "a\x1b[2J", "\ud800", "nan", "é" * 90,
    "9" * 400, "2026-01-01", "1.3.0", "9999999999.0.0",
    [], {}, [[]], [0], [None], ["a"], [1.0, 2.0, 3.0], [0] * 1000,
    {"a": 1}, {"": None}, [{}], {"a": {"b": [1]}},
)  # fmt: skip
"""What a field may hold instead of what it should."""


class Choices:
    """Reads choices from bytes; when they are used up, it is always the first."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def below(self, limit: int) -> int:
        """A number from 0 to limit - 1."""
        taken = self._data[self._at : self._at + (1 if limit <= 256 else 2)]
        self._at += 1 if limit <= 256 else 2
        return int.from_bytes(taken, "little") % limit

    def of(self, items: Sequence[T]) -> T:
        """One of some items."""
        return items[self.below(len(items))]

    @property
    def left(self) -> bool:
        """Are there bytes left?"""
        return self._at < len(self._data)


def edited(document: Any, choices: Choices) -> Any:
    """A copy of JSON values with one to four of them replaced, left out, doubled or added."""
    document = copy.deepcopy(document)
    for _ in range(1 + choices.below(4)):
        place, key = None, None
        inner = document
        while isinstance(inner, (dict, list)) and inner and not (place is not None and choices.below(4) == 0):
            place, key = inner, choices.of(sorted(inner) if isinstance(inner, dict) else range(len(inner)))
            inner = place[key]
        if place is None:
            return copy.deepcopy(choices.of(ODD))
        match choices.below(6):
            case 0 | 1 | 2:
                place[key] = copy.deepcopy(choices.of(ODD))
            case 3:
                del place[key]
            case 4 if isinstance(place, list):
                place.insert(key, copy.deepcopy(inner))
            case 4:
                place[choices.of(("more", "", "schema_version", "is"))] = copy.deepcopy(inner)
            case _:
                place[key] = {"inner": inner} if choices.below(2) else [inner]
    return document


def edited_table(table: pa.Table, choices: Choices) -> pa.Table:
    """A copy of a table with one to three of its columns, rows or facts others."""
    for _ in range(1 + choices.below(3)):
        if not table.num_columns:
            return table
        at = choices.below(table.num_columns)
        field, rows = table.schema.field(at), len(table)
        match choices.below(8):
            case 0:
                table = table.remove_column(at)
            case 1:
                names = list(table.schema.names)
                names[at] = choices.of((*names, "", "a" * 300))
                table = table.rename_columns(names)
            case 2:
                table = table.set_column(at, field, pa.nulls(rows, field.type))
            case 3:
                values, kind = choices.of(_COLUMNS)
                table = table.set_column(at, field.name, pa.array([values] * rows, kind))
            case 4:
                table = pa.concat_tables([table] * choices.of((0, 2, 3))) if choices.below(3) else table[:0]
            case 5 if pa.types.is_floating(field.type):
                value = choices.of((float("nan"), float("inf"), 1e308, -0.0, -1.0))
                table = table.set_column(at, field, pa.array(np.full(rows, value), field.type, safe=False))
            case 5 if pa.types.is_string(field.type):
                value = choices.of([v for v in ODD if isinstance(v, str) and v.isascii()])
                table = table.set_column(at, field, pa.array([value] * rows, field.type))
            case _:
                metadata = dict(table.schema.metadata or {})
                key = choices.of((*sorted(metadata), b"headturn.more"))
                value = choices.of((*_TEXTS, None, *metadata.values()))
                metadata = {k: v for k, v in metadata.items() if k != key}
                table = table.replace_schema_metadata(metadata if value is None else {**metadata, key: value})
    return table


_TEXTS = (
    b"",
    b"\xff\xfe",
    b"{}",
    b"[]",
    b"null",
    b"1.0.0",
    b"1.9.9",
    b"2.0.0",
    b"x" * 200,
    b'{"rotation": 1}',
)
_COLUMNS: tuple[tuple[Any, pa.DataType], ...] = (
    ("a", pa.string()),
    ("a", pa.large_string()),
    ("a", pa.dictionary(pa.int8(), pa.string())),
    (b"\xff", pa.binary()),
    (1, pa.int64()),
    (1, pa.uint8()),
    (1.5, pa.float64()),
    (1.5, pa.float16()),
    (True, pa.bool_()),
    (None, pa.null()),
    ([1.0, 2.0], pa.list_(pa.float64())),
    ([1.0] * 3, pa.list_(pa.float32(), 3)),
    ([], pa.list_(pa.string())),
    ({"a": 1}, pa.struct([("a", pa.int64())])),
    ([("a", 1)], pa.map_(pa.string(), pa.int64())),
    (0, pa.timestamp("us")),
    (0, pa.decimal128(38, 2)),
)  # fmt: skip

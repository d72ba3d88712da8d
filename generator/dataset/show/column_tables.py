# SPDX-License-Identifier: GPL-3.0-or-later
"""The columns as tables for people: in dataset cards and in docs/table.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import pyarrow as pa

from generator.dataset.format.columns import ROWS, Column
from generator.dataset.format.heads_table import HEADS
from generator.landmarks.topology import FACE_MESH, Topology


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown. Cells are Markdown; strangers' text in them comes through generator.escape."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def type_name(kind: pa.DataType) -> str:
    """A type as documentation has it, such as float32[1404]."""
    if pa.types.is_fixed_size_list(kind):
        return f"{type_name(kind.value_type)}[{kind.list_size}]"
    if pa.types.is_list(kind):
        return f"{type_name(kind.value_type)}[]"
    if pa.types.is_struct(kind):
        return "struct{" + ", ".join(field.name for field in kind) + "}"
    return {"double": "float64", "float": "float32"}.get(str(kind), str(kind))


def column_rows(
    columns: Iterable[Column], topology: Topology, chosen: Callable[[Column], bool] = lambda column: True
) -> list[tuple[str, str, str]]:
    """(name, type, meaning) of each chosen column. topology: how many landmarks there are."""
    return [
        (column.name, type_name(column.arrow_type(topology)), column.meaning)
        for column in columns
        if chosen(column)
    ]


def rows_table() -> str:
    """The columns of the rows, for docs/table.md."""
    return _documented(ROWS.values())


def heads_table() -> str:
    """The columns of heads.parquet, for docs/table.md."""
    return _documented(HEADS.values())


def _documented(columns: Iterable[Column]) -> str:
    since = {column.name: column.since for column in columns}
    rows = [(*row, since[row[0]].rpartition(".")[0]) for row in column_rows(columns, FACE_MESH)]
    return markdown_table(("column", "type", "meaning", "since"), rows)


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())

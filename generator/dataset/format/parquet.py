# SPDX-License-Identifier: GPL-3.0-or-later
"""The door to every Parquet file: how much memory it may take, from its footer, before a row is read.

Half a megabyte may hold three million rows, or one text that a thousand rows repeat.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from generator.limits import MAX_HEADS
from generator.reading import check_regular

MAX_FILE_BYTES = 1 << 40
MAX_BATCH_BYTES = 1 << 28
"""Of the rows that are decoded at once."""

MAX_GROUP_ROWS = 1 << 20
MAX_TABLE_BYTES = 1 << 27
MAX_RATIO = 20
"""What is larger than its limit may still unpack to so many times its size."""

_WIDTHS = {"BOOLEAN": 1, "INT32": 4, "INT64": 8, "INT96": 12, "FLOAT": 4, "DOUBLE": 8}


def open_parquet(path: Path) -> pq.ParquetFile:
    """A Parquet file whose footer was read and is sane; its page checksums are verified as it is read.

    Raises
    ------
    OSError: no regular file, or damaged. ValueError: its rows would fill the memory.
    """
    check_regular(path, MAX_FILE_BYTES)
    file = pq.ParquetFile(path, page_checksum_verification=True)
    try:
        batch_rows(file.metadata, 1)
    except ValueError:
        file.close()
        raise
    return file


def batch_rows(footer: pq.FileMetaData, wanted: int) -> int:
    """How many rows may be decoded at once: wanted, or fewer where rows are large.

    Raises ValueError: not even one.
    """
    most = wanted
    for number in range(footer.num_row_groups):
        group = footer.row_group(number)
        rows = group.num_rows
        if rows > MAX_GROUP_ROWS:
            raise ValueError(f"{rows:,} rows lie in one group, more than {MAX_GROUP_ROWS:,}")
        # What a row may hold: its numbers, and any text that the group repeats. Other texts, images
        # among them, are there once: they share what is stored of them, which hardly packs.
        a_row, once, packed = 0, 0, 0
        lists, packed_lists = 0, 0  # one row may hold the most of them
        for place in range(group.num_columns):
            column = group.column(place)
            width = _WIDTHS.get(column.physical_type)
            if width is not None:
                a_row += -(-column.num_values * width // max(rows, 1))
                if column.num_values > rows:
                    lists += column.num_values * width
                    packed_lists += column.total_compressed_size
            elif column.has_dictionary_page:
                a_row += column.total_uncompressed_size
            else:
                once += column.total_uncompressed_size
                packed += column.total_compressed_size
        for size, stored in ((a_row, 0), (once, packed), (lists, packed_lists)):
            if size > max(MAX_BATCH_BYTES, MAX_RATIO * stored):
                raise ValueError(f"its rows unpack to {size:,} bytes at once, more than {MAX_BATCH_BYTES:,}")
        most = max(1, min(most, MAX_BATCH_BYTES // max(a_row + once // max(rows, 1), 1)))
    return most


def read_table(path: Path) -> pa.Table:
    """A table with a row a head, whole.

    Raises OSError or pa.ArrowException: not readable; ValueError: more than such a table holds.
    """
    allowed = max(MAX_TABLE_BYTES, MAX_RATIO * check_regular(path, MAX_FILE_BYTES))
    with open_parquet(path) as file:
        if file.metadata.num_rows > MAX_HEADS:
            raise ValueError(f"it has {file.metadata.num_rows:,} rows, more than {MAX_HEADS:,}")
        batches, size = [], 0
        for batch in file.iter_batches(batch_rows(file.metadata, MAX_HEADS)):
            size += batch.nbytes
            if size > allowed:
                raise ValueError(f"it unpacks to more than {allowed:,} bytes")
            batches.append(batch)
        return pa.Table.from_batches(batches, file.schema_arrow)


def iter_batches(path: Path, wanted: int) -> Iterator[pa.RecordBatch]:
    """The rows of a file, at most so many at once. Raises as :func:`open_parquet` does."""
    with open_parquet(path) as file:
        yield from file.iter_batches(batch_rows(file.metadata, wanted))

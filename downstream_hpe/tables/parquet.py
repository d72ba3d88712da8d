# SPDX-License-Identifier: MIT
"""How much memory a Parquet file may take, from its footer, before a row is read.

Half a megabyte may hold three million rows, or one text that a thousand rows repeat.
"""

from __future__ import annotations

from collections.abc import Collection

import pyarrow.parquet as pq

MAX_FILE_BYTES = 1 << 40
MAX_BATCH_BYTES = 1 << 28
"""Of the columns that are read, in the rows that are decoded at once."""
MAX_ROWS = 100_000_000
MAX_RATIO = 100
"""What a file has in its columns, all rows together, may unpack to MAX_BATCH_BYTES, or else to so many
times its size."""
_WIDTHS = {"BOOLEAN": 1, "INT32": 4, "INT64": 8, "INT96": 12, "FLOAT": 4, "DOUBLE": 8}


def batch_rows(footer: pq.FileMetaData, columns: Collection[str], wanted: int) -> int:
    """How many rows of columns may be decoded at once: wanted, or fewer where rows are large.

    Raises ValueError: not even one, or all of them would fill the memory.
    """
    most, numbers, packed = wanted, 0, 0
    if footer.num_rows > MAX_ROWS:
        raise ValueError(f"{footer.num_rows:,} rows, more than {MAX_ROWS:,}")
    for number in range(footer.num_row_groups):
        group = footer.row_group(number)
        a_row = 0
        for place in range(group.num_columns):
            column = group.column(place)
            if column.path_in_schema.partition(".")[0] not in columns:
                continue
            width = _WIDTHS.get(column.physical_type)
            if width is None:
                a_row += column.total_uncompressed_size  # any text may be all that is stored
            else:
                a_row += -(-column.num_values * width // max(group.num_rows, 1))
                numbers += column.num_values * width
                packed += column.total_compressed_size
        if a_row > MAX_BATCH_BYTES:
            raise ValueError(f"a row may unpack to {a_row:,} bytes, more than {MAX_BATCH_BYTES:,}")
        most = max(1, min(most, MAX_BATCH_BYTES // max(a_row, 1)))
    if numbers > max(MAX_BATCH_BYTES, MAX_RATIO * packed):
        raise ValueError(f"its columns unpack to {numbers:,} bytes, from {packed:,}")
    return most

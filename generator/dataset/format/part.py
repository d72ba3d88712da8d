# SPDX-License-Identifier: GPL-3.0-or-later
"""One unit of work as one Parquet file: commit its table, read it back."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from generator.dataset.format.defaults import todays_schema, with_defaults
from generator.dataset.format.digest import NO_ROWS, add_digests, content_digest
from generator.dataset.format.files import (
    check_there,
    file_sha256,
    make_folder,
    one_line,
    write_atomically,
    write_files,
)
from generator.dataset.format.guard import check_texts
from generator.dataset.format.parquet import iter_batches, open_parquet
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import check_name, image_mode
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.errors import DatasetError
from generator.plan.factors import part_folder

ROW_GROUP = 1024
BATCH = 256
"""Rows read at once: bounds the memory of a check when images are embedded."""


def write_part(table: pa.Table, root: Path, split: str, unit: str, folder: str = "data") -> PartInfo:
    """Commit a table as ``data/<split>/part-<unit>.parquet`` under root, all or nothing.

    folder: of :func:`generator.plan.factors.part_folder`.

    The file is read back and its content compared with the table before it
    takes its name.

    Raises
    ------
    DatasetError: the disk is full, the folder is not writable, or what was
        read back is not what was written.
    """
    check_name("split", split)
    check_name("unit", unit)
    make_folder(root)
    return _write_part(table, root, split, unit, folder)


def _write_part(table: pa.Table, root: Path, split: str, unit: str, folder: str) -> PartInfo:
    path = root / folder / split / f"part-{unit}.parquet"

    def check(temporary: Path) -> PartInfo:
        info = check_part(temporary)
        if info.rows != len(table) or info.digest != content_digest(table):
            raise DatasetError(f"{path}: what was read back differs from what was written; check the disk")
        return replace(info, path=f"{folder}/{split}/{path.name}")

    return write_atomically(path, lambda file: write_table(table, file), check, root)


def commit_unit(rows: UnitRows, schema: pa.Schema, root: Path, unit: str) -> PartInfo:
    """Store one unit: its image files where images = "files", its passes, then its part.

    Raises DatasetError as :func:`write_part` does; then the part is not there.
    """
    check_name("split", rows.split)
    check_name("unit", unit)
    table = unit_table(rows, schema)
    check_there(root)
    if image_mode(schema) == "files":
        # The part that vouches for them comes last, so they need no rename of their own.
        write_files(
            {root / path: image for path, image in zip(rows.image_paths, rows.images, strict=True)}, root
        )
    if rows.passes is not None:
        files = zip(rows.passes_paths, rows.passes, strict=True)
        write_files({root / path: content for path, (content, _) in files}, root)
    return _write_part(table, root, rows.split, unit, part_folder(rows.factor))


def iter_stored(path: Path) -> Iterator[pa.RecordBatch]:
    """The rows of one part as they are stored, in batches of at most 256, page checksums verified.

    Raises DatasetError: the file is missing, cut short or damaged.
    """
    with reading(path):
        yield from iter_batches(path, BATCH)


def iter_checked(path: Path) -> Iterator[pa.RecordBatch]:
    """As :func:`iter_stored`; raises DatasetError as well for names that are none."""
    for batch in iter_stored(path):
        check_texts(batch, path)
        yield batch


def iter_part(path: Path) -> Iterator[pa.RecordBatch]:
    """As :func:`iter_checked`, with the defaults of columns that an older part lacks."""
    schema = todays_schema(part_schema_of(path), str(path))
    for batch in iter_checked(path):
        yield with_defaults(batch, schema)


def part_schema_of(path: Path) -> pa.Schema:
    """Schema of one part as it is stored, with its metadata. Raises as :func:`iter_stored` does."""
    with reading(path), open_parquet(path) as file:
        return file.schema_arrow


def read_part(path: Path) -> pa.Table:
    """All rows of one part, with the defaults of columns that an older part lacks.

    Raises DatasetError as :func:`iter_stored` does.
    """
    schema = todays_schema(part_schema_of(path), str(path))
    return pa.Table.from_batches(iter_part(path), schema=schema)


def check_part(path: Path) -> PartInfo:
    """Read a part from the first byte to the last and say what it holds.

    path: ``<dataset>/data/<split>/<name>``, or below twins.
    Raises DatasetError as :func:`iter_stored` does, or if its columns are not those of a part.
    """
    rows, detected, digests = 0, 0, [NO_ROWS]
    heads: set[tuple[str, str]] = set()
    for batch in iter_stored(path):
        with reading(path):
            digests.append(content_digest(batch))
            detected += pc.sum(batch.column("detected")).as_py()
            heads.update(zip(*(batch.column(n).to_pylist() for n in ("subject", "expression")), strict=True))
        rows += len(batch)
    subject, expression = heads.pop() if len(heads) == 1 else ("", "")
    return PartInfo(
        path="/".join(path.parts[-3:]),
        rows=rows,
        detected=detected,
        bytes=path.stat().st_size,
        sha256=file_sha256(path),
        digest=add_digests(digests),
        subject=subject,
        expression=expression,
    )


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """A block that reads a part; whatever it cannot read becomes a DatasetError that names the file."""
    try:
        yield
    except (OSError, pa.ArrowException, KeyError, TypeError, ValueError) as error:
        raise DatasetError(
            f"{path}: not a readable part ({one_line(error)}); delete it and run `headturn build` again, "
            "or take it from a copy"
        ) from error


def write_table(table: pa.Table, file: BinaryIO) -> None:
    """Write rows as Parquet the way every part is: zstd, page checksums, landmarks split by byte."""
    with part_writer(file, table.schema) as writer:
        writer.write_table(table, row_group_size=ROW_GROUP)


def part_writer(file: BinaryIO, schema: pa.Schema) -> pq.ParquetWriter:
    """A writer for rows that come piece by piece; see :func:`write_table`."""
    lists = [field.name for field in schema if pa.types.is_nested(field.type)]
    scalars = [name for name in schema.names if name not in lists]
    return pq.ParquetWriter(
        file,
        schema,
        compression="zstd",
        use_dictionary=[name for name in scalars if pa.types.is_string(schema.field(name).type)],
        use_byte_stream_split=[f"{name}.list.element" for name in lists if _is_noise(schema.field(name))],
        write_statistics=scalars,
        write_page_index=True,
        write_page_checksum=True,
    )


def row_groups(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.Table]:
    """Batches in tables of at most ROW_GROUP rows, for :func:`part_writer`."""
    while group := list(islice(batches, ROW_GROUP // BATCH)):
        yield pa.Table.from_batches(group)


def _is_noise(field: pa.Field) -> bool:
    """Floats of landmarks: nothing but splitting them by byte makes them smaller."""
    return pa.types.is_fixed_size_list(field.type) and field.type.value_type == pa.float32()

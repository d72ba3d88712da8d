# SPDX-License-Identifier: MIT
"""Headturn's Parquet tables: opened, checked and read batch by batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.dataset as ds
from pyarrow import fs

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.face_mesh import TOPOLOGY
from downstream_hpe.reading import check_regular, parse_json
from downstream_hpe.tables.columns import ROTATION, check_columns
from downstream_hpe.tables.parquet import MAX_FILE_BYTES, batch_rows

SCHEMA_MAJOR = "1"
BATCH_ROWS = 1024


@dataclass(frozen=True)
class Tables:
    """The files of one dataset, their columns and conventions checked.

    path: the folder or file as given, for messages.
    """

    path: Path
    files: tuple[ds.ParquetFileFragment, ...]

    def batches(self, columns: Sequence[str], where: ds.Expression | None = None) -> Iterator[pa.RecordBatch]:
        """Every row that passes where, in the order of the files; at most BATCH_ROWS at once."""
        for file in self.files:
            yield from file_batches(file, columns, where)


def open_tables(path: Path | str, columns: Sequence[str]) -> Tables:
    """The tables under a dataset, a folder of Parquet files, or one file.

    Raises
    ------
    DataError: nothing there, a file that is no Headturn table or lacks one of columns, or files
        that do not share one set of conventions, schema version and landmark topology.
    """
    where = Path(path)
    files = tuple(_open(file) for file in _parquet_files(where))
    first: tuple[str, dict[str, str]] | None = None
    for file in files:
        schema = file.physical_schema
        check_columns(file.path, schema, columns, "expected a table of headturn build")
        facts = _facts(file.path, schema)
        if first is None:
            first = (file.path, facts)
        for key, value in facts.items():
            if value != first[1][key]:
                raise DataError(
                    f"{file.path}: {key} differs from that of {first[0]}; read one dataset at a time"
                )
    return Tables(where, files)


def file_batches(
    file: ds.ParquetFileFragment, columns: Sequence[str], where: ds.Expression | None
) -> Iterator[pa.RecordBatch]:
    """Rows of one file that pass where; only the row groups and columns needed are read.

    Raises
    ------
    DataError: the file is damaged, or would fill the memory.
    """
    try:
        rows = batch_rows(file.metadata, columns, BATCH_ROWS)
    except ValueError as error:
        raise DataError(f"{file.path}: {error}; headturn verify says more of it") from error
    # Without read-ahead one batch is in memory, not sixteen.
    scanner = file.scanner(
        columns=list(columns), filter=where, batch_size=rows, batch_readahead=0, use_threads=False
    )
    try:
        for batch in scanner.to_batches():
            batch.validate(full=True)  # Parquet says that a text is UTF-8, and need not be right
            if len(batch):
                yield batch
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"{file.path}: damaged; headturn verify says more of it") from error


def _parquet_files(where: Path) -> list[Path]:
    if where.is_file():
        return [where]
    if not where.exists():
        raise DataError(f"{where}: not there; expected a dataset made by headturn build")
    folder = where / "data" if (where / "data").is_dir() else where
    files = sorted(folder.rglob("*.parquet"))
    if not files:
        raise DataError(f"{where}: no .parquet file; expected a dataset made by headturn build")
    return files


def _open(path: Path) -> ds.ParquetFileFragment:
    try:
        check_regular(path, MAX_FILE_BYTES)
        fragment = ds.ParquetFileFormat().make_fragment(str(path), fs.LocalFileSystem())
        fragment.ensure_complete_metadata()
        fragment.physical_schema.names  # noqa: B018 - which need not be text
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"{path}: not a readable Parquet file; expected one of headturn build") from error
    return fragment


def _facts(path: str, schema: pa.Schema) -> dict[str, str]:
    """What all files must agree on, by its name in the metadata."""
    try:
        metadata = {key.decode(): value.decode() for key, value in (schema.metadata or {}).items()}
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: its metadata are no text; expected a table of headturn build") from error
    facts = {}
    for name in ("schema_version", "landmark_topology", "conventions"):
        if f"headturn.{name}" not in metadata:
            raise DataError(f"{path}: no headturn.{name} in its metadata; expected a table of headturn build")
        facts[name] = metadata[f"headturn.{name}"]
    if facts["schema_version"].split(".")[0] != SCHEMA_MAJOR:
        raise DataError(
            f"{path}: schema version {facts['schema_version'][:80]}, expected {SCHEMA_MAJOR}.x; "
            "use the version of Headturn that wrote it"
        )
    if facts["landmark_topology"] != TOPOLOGY:
        raise DataError(f"{path}: landmark topology {facts['landmark_topology'][:80]}, expected {TOPOLOGY}")
    try:
        rotation = parse_json(facts["conventions"])["rotation"]
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path}: headturn.conventions names no rotation") from error
    if not isinstance(rotation, str) or ROTATION not in rotation:
        raise DataError(f"{path}: rotation convention {str(rotation)[:80]!r}, expected {ROTATION}")
    return facts

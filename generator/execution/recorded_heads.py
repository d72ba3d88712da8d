# SPDX-License-Identifier: GPL-3.0-or-later
"""The heads of a finished dataset, found again where they lie and checked against what was recorded."""

from __future__ import annotations

from pathlib import Path

from generator.dataset.format.files import file_sha256
from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.errors import HeadError, HeadturnError
from generator.execution.build.sources import source_path
from generator.heads.head import Head
from generator.heads.source import find_heads
from generator.plan.config import BuildConfig

Key = tuple[str, str]
"""Subject and expression."""

_AGAIN = "give the place it was moved to with --heads, or put it back"


class RecordedHeads:
    """Finds each head once. moved: where the source lies now, None where it was.

    Raises DatasetError if heads.parquet cannot be read.
    """

    def __init__(self, root: Path, config: BuildConfig, moved: Path | None) -> None:
        self._root, self._config = root, config
        self.rows = {(row.subject, row.expression): row for row in read_heads(root)}
        self._path = moved or source_path(config, root)
        self._source: dict[Key, Head] | None = None
        self._found: dict[Key, Head | HeadturnError] = {}
        self._sha256: dict[str, str] = {}  # of files that expressions share

    def of(self, key: Key) -> Head:
        """A head. Raises HeadError: it is not there, or not as it was; UsageError: its source is none."""
        if key not in self._found:
            try:
                self._found[key] = self._find(key)
            except HeadturnError as error:
                self._found[key] = error
        found = self._found[key]
        if isinstance(found, HeadturnError):
            raise found
        return found

    def _find(self, key: Key) -> Head:
        row = self.rows.get(key)
        if row is None:
            raise HeadError(f"{self._root}: heads.parquet lacks {'/'.join(key)}; see `headturn verify`")
        self._check_files(row)
        if self._source is None:
            self._source = self._read_source()
        if key not in self._source:
            raise HeadError(f"{self._path}: no head {'/'.join(key)} there any more; {_AGAIN}")
        return self._source[key]

    def _check_files(self, row: HeadRow) -> None:
        """Raises HeadError unless the files have the hashes of the build."""
        if not self._path.exists():
            raise HeadError(f"{self._path}: the heads of this dataset are not there any more; {_AGAIN}")
        base = self._path if self._path.is_dir() else self._path.parent
        for name, sha256 in row.file_sha256:
            if not (base / name).is_file():
                raise HeadError(f"{base / name}: a file of {row.subject}/{row.expression} is gone; {_AGAIN}")
            if name not in self._sha256:
                self._sha256[name] = file_sha256(base / name)
            if self._sha256[name] != sha256:
                raise HeadError(
                    f"{base / name}: was changed after the build (SHA-256 differs); replay needs the "
                    "file as it was"
                )

    def _read_source(self) -> dict[Key, Head]:
        wanted = self._config.heads
        source = find_heads(
            self._path,
            expressions=wanted.expressions,
            license=wanted.license,
            redistributable=wanted.redistributable,
            units=wanted.units,
            up=wanted.up,
            forward=wanted.forward,
            eye_distance_mm=wanted.eye_distance_mm,
            without=wanted.without,
            head_object=wanted.head_object,
        )
        return {(head.subject, head.expression): head for head in source.heads}

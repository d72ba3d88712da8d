# SPDX-License-Identifier: MIT
"""Headturn's Parquet tables: opened, checked and read batch by batch."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds
from pyarrow import fs

from downstream_hpe.errors import DataError
from downstream_hpe.normalise import POINTS
from downstream_hpe.rotation import rotation_from_angles

SCHEMA_MAJOR = "1"
TOPOLOGY = "mediapipe-face-mesh-468"
ROTATION = "Rx(-pitch) Ry(yaw) Rz(roll)"

ANGLE_COLUMNS = ("yaw_deg", "pitch_deg", "roll_deg")
INDEX_COLUMNS = ("yaw_index", "pitch_index", "roll_index")
HEAD_COLUMNS = ("subject", "expression")
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


@dataclass(frozen=True)
class Rows:
    """Detected rows, in memory.

    heads      str [N], "subject/expression"; subjects str [N]: what a split must not divide
    ypr_deg    float64 [N, 3]; rotation float64 [N, 3, 3], R_C
    landmarks  float32 [N, 468, 3], isotropic pixels, frame C
    undetected number of rows left out because no face was found
    """

    heads: np.ndarray
    subjects: np.ndarray
    ypr_deg: np.ndarray
    rotation: np.ndarray
    landmarks: np.ndarray
    undetected: int

    def __len__(self) -> int:
        return len(self.ypr_deg)

    def take(self, chosen: np.ndarray) -> Rows:
        """The chosen rows. chosen: bool or int, as numpy indexes."""
        arrays = (self.heads, self.subjects, self.ypr_deg, self.rotation, self.landmarks)
        heads, subjects, ypr_deg, rotation, points = (array[chosen] for array in arrays)
        return Rows(heads, subjects, ypr_deg, rotation, points, 0)

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """The rows of several, one after the other."""
        names = ("heads", "subjects", "ypr_deg", "rotation", "landmarks")
        arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        heads, subjects, ypr_deg, rotation, points = arrays
        return Rows(heads, subjects, ypr_deg, rotation, points, sum(part.undetected for part in parts))


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
        missing = [name for name in columns if name not in schema.names]
        if missing:
            raise DataError(
                f"{file.path}: no column {', '.join(missing)}; expected a table of headturn build"
            )
        facts = _facts(file.path, schema)
        if first is None:
            first = (file.path, facts)
        for key, value in facts.items():
            if value != first[1][key]:
                raise DataError(
                    f"{file.path}: {key} differs from that of {first[0]}; read one dataset at a time"
                )
    return Tables(where, files)


def read_rows(path: Path | str, split: str | None = None) -> Rows:
    """Every detected row, in the order of the files.

    split: only the rows of this split; None: all of them.

    Raises
    ------
    DataError: as :func:`open_tables`; no detected row; a row whose rotation is not that of its
        angles, or whose landmarks are not finite although it is marked detected.
    """
    columns = [*HEAD_COLUMNS, "split", *ANGLE_COLUMNS, "rotation", "detected", "landmarks"]
    tables = open_tables(path, columns)
    chosen = None if split is None else ds.field("split") == split
    found: list[tuple[np.ndarray, ...]] = []
    undetected = 0
    for batch in tables.batches(columns, chosen):
        detected = column(batch, "detected")
        check_rows(tables.path, batch)
        undetected += int((~detected).sum())
        subjects = column(batch, "subject")
        heads = np.array([f"{s}/{e}" for s, e in zip(subjects, column(batch, "expression"), strict=True)])
        values = (
            heads, subjects, angles(batch), vectors(batch, "rotation", 9).reshape(-1, 3, 3), landmarks(batch)
        )  # fmt: skip
        found.append(tuple(value[detected] for value in values))
    if not sum(len(values[0]) for values in found):
        of = f" of split {split!r}" if split else ""
        raise DataError(f"{tables.path}: no row{of} with a detected face; nothing to read")
    every = (np.concatenate(values) for values in zip(*found, strict=True))
    all_heads, all_subjects, ypr_deg, rotation, points = every
    return Rows(all_heads, all_subjects, ypr_deg, rotation, points, undetected)


def read_missed(path: Path | str, split: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The rows that :func:`read_rows` leaves out: their subjects, str [M], and angles, float64 [M, 3]."""
    columns = ["subject", "split", *ANGLE_COLUMNS, "detected"]
    where = ~ds.field("detected")
    if split is not None:
        where &= ds.field("split") == split
    batches = list(open_tables(path, columns).batches(columns, where))
    subjects = [str(name) for batch in batches for name in column(batch, "subject")]
    return np.array(subjects, dtype=np.str_), np.concatenate([np.empty((0, 3)), *map(angles, batches)])


def subjects_by_split(path: Path | str) -> dict[str, set[str]]:
    """The subjects of each split.

    Raises
    ------
    DataError: as :func:`open_tables`; a subject in two splits, which would test on a trained face.
    """
    columns = ["subject", "split"]
    tables = open_tables(path, columns)
    splits: dict[str, set[str]] = {}
    for batch in tables.batches(columns):
        for subject, split in set(zip(*(column(batch, name) for name in columns), strict=True)):
            splits.setdefault(split, set()).add(subject)
    seen: dict[str, str] = {}
    for split, subjects in splits.items():
        for subject in subjects:
            if subject in seen:
                raise DataError(f"{tables.path}: {subject} is in the splits {seen[subject]!r} and {split!r}")
            seen[subject] = split
    return splits


def file_batches(
    file: ds.ParquetFileFragment, columns: Sequence[str], where: ds.Expression | None
) -> Iterator[pa.RecordBatch]:
    """Rows of one file that pass where; only the row groups and columns needed are read.

    Raises
    ------
    DataError: the file is damaged.
    """
    # Without read-ahead one batch is in memory, not sixteen.
    scanner = file.scanner(
        columns=list(columns), filter=where, batch_size=BATCH_ROWS, batch_readahead=0, use_threads=False
    )
    try:
        yield from (batch for batch in scanner.to_batches() if len(batch))
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"{file.path}: damaged; headturn verify says more of it") from error


def column(batch: pa.RecordBatch, name: str) -> np.ndarray:
    """One column of scalars: [N]. DataError if a value is null."""
    values = batch.column(name)
    if values.null_count:
        raise DataError(f"column {name} has {values.null_count} nulls; a table of headturn build has none")
    return values.to_numpy(zero_copy_only=False)


def vectors(batch: pa.RecordBatch, name: str, size: int) -> np.ndarray:
    """One column of fixed-size lists: [N, size]. DataError if a list has another length."""
    values = batch.column(name).flatten()
    if len(values) != len(batch) * size or values.null_count:
        raise DataError(f"column {name}: expected {size} numbers a row")
    return values.to_numpy(zero_copy_only=False).reshape(-1, size)


def angles(batch: pa.RecordBatch) -> np.ndarray:
    """(yaw, pitch, roll) in degrees, float64 [N, 3]."""
    return np.stack([column(batch, name) for name in ANGLE_COLUMNS], axis=-1)


def landmarks(batch: pa.RecordBatch) -> np.ndarray:
    """float32 [N, 468, 3], isotropic pixels, frame C; NaN where not detected."""
    return vectors(batch, "landmarks", 3 * POINTS).reshape(-1, POINTS, 3)


def check_rows(where: Path, batch: pa.RecordBatch) -> None:
    """DataError unless rotations are those of the angles and detected landmarks are finite."""
    wrong = ~np.isfinite(landmarks(batch)).all(axis=(1, 2)) & column(batch, "detected")
    if wrong.any():
        raise DataError(f"{where}: {_row(batch, wrong)} is detected but its landmarks are not finite")
    expected = rotation_from_angles(angles(batch)).reshape(-1, 9)
    wrong = ~(np.abs(vectors(batch, "rotation", 9) - expected).max(axis=1) < 1e-6)
    if wrong.any():
        raise DataError(f"{where}: rotation of {_row(batch, wrong)} is not {ROTATION} of its angles")


def _row(batch: pa.RecordBatch, wrong: np.ndarray) -> str:
    first = int(np.argmax(wrong))
    row = {name: batch.column(name)[first].as_py() for name in (*HEAD_COLUMNS, *ANGLE_COLUMNS)}
    head = f"{row['subject']}/{row['expression']}"
    return cell_name(head, (row["yaw_deg"], row["pitch_deg"], row["roll_deg"]))


def cell_name(head: str, ypr_deg: Sequence[float]) -> str:
    """How messages name one row."""
    return f"{head} at yaw {ypr_deg[0]:g}, pitch {ypr_deg[1]:g}, roll {ypr_deg[2]:g}"


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
    fragment = ds.ParquetFileFormat().make_fragment(str(path), fs.LocalFileSystem())
    try:
        fragment.ensure_complete_metadata()
    except (pa.ArrowInvalid, OSError) as error:
        raise DataError(f"{path}: not a readable Parquet file; expected one of headturn build") from error
    return fragment


def _facts(path: str, schema: pa.Schema) -> dict[str, str]:
    """What all files must agree on, by its name in the metadata."""
    metadata = {key.decode(): value.decode() for key, value in (schema.metadata or {}).items()}
    facts = {}
    for name in ("schema_version", "landmark_topology", "conventions"):
        if f"headturn.{name}" not in metadata:
            raise DataError(f"{path}: no headturn.{name} in its metadata; expected a table of headturn build")
        facts[name] = metadata[f"headturn.{name}"]
    if facts["schema_version"].split(".")[0] != SCHEMA_MAJOR:
        raise DataError(
            f"{path}: schema version {facts['schema_version']}, expected {SCHEMA_MAJOR}.x; "
            "use the version of Headturn that wrote it"
        )
    if facts["landmark_topology"] != TOPOLOGY:
        raise DataError(f"{path}: landmark topology {facts['landmark_topology']}, expected {TOPOLOGY}")
    try:
        rotation = json.loads(facts["conventions"])["rotation"]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise DataError(f"{path}: headturn.conventions names no rotation") from error
    if ROTATION not in rotation:
        raise DataError(f"{path}: rotation convention {rotation!r}, expected {ROTATION}")
    return facts

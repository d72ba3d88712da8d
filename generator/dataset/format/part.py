# SPDX-License-Identifier: GPL-3.0-or-later
"""One unit of work as one Parquet file: build the table, commit it, read it back."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from generator.dataset.format.digest import NO_ROWS, add_digests, content_digest
from generator.dataset.format.files import file_sha256, one_line, write_atomically, write_files
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import (
    LANDMARK_COLUMNS,
    LANDMARKS,
    check_name,
    image_mode,
    image_path,
    passes_path,
    sample_id,
)
from generator.errors import DatasetError
from generator.geometry.camera import Camera
from generator.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from generator.plan.poses import ANGLES, pose_name

NUMPY_TYPES = {pa.float64(): np.float64, pa.float32(): np.float32, pa.bool_(): np.bool_}
"""Of list elements. (pyarrow's own mapping needs pandas, which a build does not.)"""

ROW_GROUP = 1024
BATCH = 256
"""Rows read at once: bounds the memory of a check when images are embedded."""


@dataclass(frozen=True, eq=False)
class UnitRows:
    """What rendering and detecting one unit gives: one head, N poses.

    angles_deg     float64 [N, 3] (yaw, pitch, roll); indices int16 [N, 3]: rows of a PosePlan
    camera         the camera of every row
    detected       bool [N]
    landmarks      float32 [N, 468, 3], isotropic pixels, frame C; NaN where not detected
    anchors        float64 [468, 3], the points on the mesh at pose zero, frame C, mm, pivot at
                   the origin; NaN where the head has none
    visible        bool [N, 468], False where there is no anchor
    images         N encoded image files; image_suffix is theirs, such as ".png"
    passes         N multilayer OpenEXR files and the SHA-256 of their decoded floats; None
                   where no passes were asked for
    """

    subject: str
    expression: str
    split: str
    head_license: str
    redistributable: bool
    angles_deg: np.ndarray
    indices: np.ndarray
    cameras: tuple[Camera, ...]
    detected: np.ndarray
    landmarks: np.ndarray
    anchors: np.ndarray
    visible: np.ndarray
    images: Sequence[bytes]
    image_suffix: str = ".png"
    passes: Sequence[tuple[bytes, str]] | None = None

    def __post_init__(self) -> None:
        count = len(self.angles_deg)
        shapes = {
            "angles_deg": (self.angles_deg.shape, (count, 3)),
            "indices": (self.indices.shape, (count, 3)),
            "detected": (self.detected.shape, (count,)),
            "landmarks": (self.landmarks.shape, (count, LANDMARKS, 3)),
            "anchors": (self.anchors.shape, (LANDMARKS, 3)),
            "visible": (self.visible.shape, (count, LANDMARKS)),
            "images": ((len(self.images),), (count,)),
        }
        for name, (actual, expected) in shapes.items():
            if actual != expected:
                raise ValueError(f"{name}: expected shape {expected}, got {actual}")
        finite = np.isfinite(self.landmarks).all(axis=(1, 2))
        missing = np.isnan(self.landmarks).all(axis=(1, 2))
        if not np.where(self.detected, finite, missing).all():
            raise ValueError("landmarks must be finite where detected and all NaN where not")
        anchored = np.isfinite(self.anchors).all(axis=1)
        if not np.where(anchored, True, np.isnan(self.anchors).all(axis=1)).all():
            raise ValueError("an anchor must be finite or all NaN")
        if self.visible[:, ~anchored].any():
            raise ValueError("a point without an anchor cannot be visible")
        if self.passes is not None and len(self.passes) != count:
            raise ValueError(f"passes: expected {count}, got {len(self.passes)}")
        for what in ("subject", "expression", "split"):
            check_name(what, getattr(self, what))

    @property
    def poses(self) -> list[str]:
        """The name of each pose."""
        return [pose_name(*angles) for angles in self.angles_deg.tolist()]

    @property
    def image_paths(self) -> list[str]:
        """Where each image is stored with images = "files", relative to the dataset."""
        return [image_path(self.subject, self.expression, pose, self.image_suffix) for pose in self.poses]

    @property
    def passes_paths(self) -> list[str]:
        """Where the passes of each image are stored, relative to the dataset; "" without passes."""
        if self.passes is None:
            return [""] * len(self.angles_deg)
        return [passes_path(self.subject, self.expression, pose) for pose in self.poses]

    @property
    def landmarks_exact(self) -> np.ndarray:
        """R_C X + t of the anchors X, float32 [N, 468, 3], frame C, mm."""
        rotation = rotation_from_angles(self.angles_deg)
        points = self.anchors @ np.swapaxes(rotation, -1, -2) + self.cameras[0].translation_mm
        return points.astype(np.float32)


def unit_table(rows: UnitRows, schema: pa.Schema) -> pa.Table:
    """The table of one unit, in the order of rows. schema: see ``part_schema`` of the schema module."""
    count = len(rows.angles_deg)
    mode = image_mode(schema)
    rotation = rotation_from_angles(rows.angles_deg)
    same_everywhere: dict[str, Any] = {
        "subject": rows.subject,
        "expression": rows.expression,
        "split": rows.split,
        "head_license": rows.head_license,
        "redistributable": rows.redistributable,
        "camera": rows.cameras[0].matrix,
        "translation_mm": rows.cameras[0].translation_mm,
        "projection": rows.cameras[0].projection,
        "width": rows.cameras[0].width,
        "height": rows.cameras[0].height,
    }
    values: dict[str, Any] = {
        **{name: np.broadcast_to(v, (count, *np.shape(v))) for name, v in same_everywhere.items()},
        "sample_id": [sample_id(rows.subject, rows.expression, pose) for pose in rows.poses],
        "rotation": rotation,
        "quaternion": quaternion_from_rotation(rotation),
        "detected": rows.detected,
        "landmarks": rows.landmarks,
        "landmarks_exact": rows.landmarks_exact,
        "landmarks_visible": rows.visible,
        "image_path": rows.image_paths if mode == "files" else [""] * count,
        "image_sha256": [hashlib.sha256(image).hexdigest() for image in rows.images],
        "passes_path": rows.passes_paths,
        "passes_sha256": [digest for _, digest in rows.passes] if rows.passes else [""] * count,
    }
    for axis, angle in enumerate(ANGLES):
        values[f"{angle}_deg"] = rows.angles_deg[:, axis]
        values[f"{angle}_index"] = rows.indices[:, axis]
    if mode == "embedded":
        names = [path.rpartition("/")[2] for path in rows.image_paths]
        values["image"] = [{"bytes": b, "path": n} for b, n in zip(rows.images, names, strict=True)]
    return pa.table([_column(values[field.name], field.type) for field in schema], schema=schema)


def write_part(table: pa.Table, root: Path, split: str, unit: str) -> PartInfo:
    """Commit a table as ``data/<split>/part-<unit>.parquet`` under root, all or nothing.

    The file is read back and its content compared with the table before it
    takes its name.

    Raises
    ------
    DatasetError: the disk is full, the folder is not writable, or what was
        read back is not what was written.
    """
    check_name("split", split)
    check_name("unit", unit)
    path = root / "data" / split / f"part-{unit}.parquet"

    def check(temporary: Path) -> PartInfo:
        info = check_part(temporary)
        if info.rows != len(table) or info.digest != content_digest(table):
            raise DatasetError(f"{path}: what was read back differs from what was written; check the disk")
        return replace(info, path=f"data/{split}/{path.name}")

    return write_atomically(path, lambda file: write_table(table, file), check)


def commit_unit(rows: UnitRows, schema: pa.Schema, root: Path, unit: str) -> PartInfo:
    """Store one unit: its image files where images = "files", its passes, then its part.

    Raises DatasetError as :func:`write_part` does; then the part is not there.
    """
    table = unit_table(rows, schema)
    if image_mode(schema) == "files":
        # The part that vouches for them comes last, so they need no rename of their own.
        write_files({root / path: image for path, image in zip(rows.image_paths, rows.images, strict=True)})
    if rows.passes is not None:
        files = zip(rows.passes_paths, rows.passes, strict=True)
        write_files({root / path: content for path, (content, _) in files})
    return write_part(table, root, rows.split, unit)


def iter_part(path: Path) -> Iterator[pa.RecordBatch]:
    """The rows of one part in batches of at most 256, page checksums verified.

    Raises DatasetError: the file is missing, cut short or damaged.
    """
    with reading(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        yield from file.iter_batches(batch_size=BATCH)


def part_schema_of(path: Path) -> pa.Schema:
    """Schema of one part with its metadata. Raises DatasetError as :func:`iter_part` does."""
    with reading(path):
        return pq.read_schema(path)


def read_part(path: Path) -> pa.Table:
    """All rows of one part. Raises DatasetError as :func:`iter_part` does."""
    schema = part_schema_of(path)
    return pa.Table.from_batches(iter_part(path), schema=schema)


def check_part(path: Path) -> PartInfo:
    """Read a part from the first byte to the last and say what it holds.

    path: ``<dataset>/data/<split>/<name>``.
    Raises DatasetError as :func:`iter_part` does, or if its columns are not those of a part.
    """
    rows, detected, digests = 0, 0, [NO_ROWS]
    heads: set[tuple[str, str]] = set()
    for batch in iter_part(path):
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
            f"{path}: not a readable part ({one_line(error)}); delete it and run `headturn build` again"
        ) from error


def _column(values: Any, kind: pa.DataType) -> pa.Array:
    if not pa.types.is_fixed_size_list(kind):
        return pa.array(values, type=kind)
    flat = np.ascontiguousarray(values, dtype=NUMPY_TYPES[kind.value_type]).reshape(-1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind)


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
        use_byte_stream_split=[f"{name}.list.element" for name in LANDMARK_COLUMNS],
        write_statistics=scalars,
        write_page_index=True,
        write_page_checksum=True,
    )

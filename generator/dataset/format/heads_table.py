# SPDX-License-Identifier: GPL-3.0-or-later
"""heads.parquet: where every head comes from, how it was placed, what one may do with it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.columns import SCHEMA_VERSION, Column, columns_at, list_of
from generator.dataset.format.files import one_line, write_atomically
from generator.dataset.format.guard import check_head_texts, dataset_file
from generator.dataset.format.parquet import read_table
from generator.dataset.format.schema import check_schema_version, is_newer, schema_version_of
from generator.errors import DatasetError
from generator.escape import quoted
from generator.geometry.camera import Camera, Projection
from generator.geometry.scene_camera import SceneCamera
from generator.heads.head import SCENE
from generator.landmarks.anchors import WAYS
from generator.landmarks.topology import FACE_MESH
from generator.names import source_path_problem

HEADS_FILE = "heads.parquet"
IDENTITY = tuple(np.eye(3).reshape(-1).tolist())
NAN = float("nan")

_TEXT, _NUMBER, _COUNT = pa.string(), pa.float64(), pa.int32()
_FILE = pa.struct([pa.field("path", _TEXT, nullable=False), pa.field("sha256", _TEXT, nullable=False)])


def column(
    kind: pa.DataType, meaning: str, check: str = "heads and poses", since: str = "1.0.0"
) -> dict[str, Any]:
    """What a field of :class:`HeadRow` says about its column besides its name.

    See :class:`generator.dataset.format.columns.Column`. The field's default is also what a reader
    takes where an older dataset lacks the column.
    """
    return {"type": kind, "meaning": meaning, "check": check, "since": since}


@dataclass(frozen=True, kw_only=True)
class HeadRow:
    """One head of the dataset; its fields are the columns of heads.parquet, in their order."""

    subject: str = field(metadata=column(_TEXT, "the person"))
    expression: str = field(metadata=column(_TEXT, "the expression, such as neutral"))
    source: str = field(metadata=column(_TEXT, "the kind of head source it was read from"))
    mesh_path: str = field(
        metadata=column(_TEXT, 'of the mesh, relative to the root of its source, with "/"')
    )
    file_sha256: tuple[tuple[str, str], ...] = field(
        metadata=column(
            list_of(_FILE), "path (as mesh_path) and SHA-256 of every file that decides the result"
        )
    )
    license: str = field(metadata=column(_TEXT, "the head's own licence", check="identity"))
    redistributable: bool = field(
        metadata=column(pa.bool_(), "may renders of the head be published?", check="identity")
    )
    attribution: str = field(metadata=column(_TEXT, "whom its licence wants named"))
    units: str = field(metadata=column(_TEXT, "unit of the mesh, such as cm"))
    mm_per_unit: float = field(metadata=column(_NUMBER, "millimetres in one unit of the mesh"))
    up: str = field(metadata=column(_TEXT, "the mesh's axis of the crown, such as +Y"))
    forward: str = field(metadata=column(_TEXT, "the mesh's axis of the nose, such as +Z"))
    pivot: tuple[float, float, float] = field(
        metadata=column(list_of(_NUMBER, 3), "centre of the rotation in the mesh's own units and axes")
    )
    radius_mm: float = field(metadata=column(_NUMBER, "of the sphere about the pivot that holds the face"))
    distance_mm: float = field(metadata=column(_NUMBER, "camera to pivot", check="camera"))
    lens_mm: float = field(metadata=column(_NUMBER, "focal length on a 36 mm sensor", check="camera"))
    projection: Projection = field(
        default="perspective",
        metadata=column(_TEXT, "perspective or orthographic", check="camera", since="1.1.0"),
    )
    frame: str = field(
        default="source",
        metadata=column(
            _TEXT,
            "where pose zero is: source (the mesh's own axes), level (a detector reads it as level) or "
            "canonical (levelled as in earlier releases)",
            since="1.1.0",
        ),
    )
    correction: tuple[float, ...] = field(
        default=IDENTITY,
        metadata=column(
            list_of(_NUMBER, 9),
            "R_U, row-major, that turns the mesh from its own axes (after up and forward) to pose zero "
            "level, or canonical where frame is that or the dataset of content version 1; applied unless "
            "frame is source",
        ),
    )
    correction_sd_deg: tuple[float, ...] = field(
        default=(NAN,) * 3,
        metadata=column(
            list_of(_NUMBER, 3),
            "how sure it is, about the axes of yaw, pitch and roll; NaN where no face was found",
            since="1.1.0",
        ),
    )
    anchor_views: int = field(
        default=0,
        metadata=column(
            _COUNT,
            "detections that the anchors are the mean of; 0: no face was found near the front",
            check="anchors",
            since="1.1.0",
        ),
    )
    anchor_off: int = field(
        default=0,
        metadata=column(
            _COUNT,
            "points that fell off the silhouette, or past it, and lie on the nearest surface",
            check="anchors",
            since="1.1.0",
        ),
    )
    anchor_absent: int = field(
        default=FACE_MESH.count,
        metadata=column(
            _COUNT, "points without an anchor: NaN in landmarks_exact", check="anchors", since="1.1.0"
        ),
    )
    anchor_residual_px: float = field(
        default=NAN,
        metadata=column(
            _NUMBER,
            "rms distance of the detections from the projected anchors, pixels of views 384 wide",
            check="anchors",
            since="1.1.0",
        ),
    )
    anchor_residual_mm: float = field(
        default=NAN,
        metadata=column(
            _NUMBER,
            "median distance of the hits from the anchors on the surface",
            check="anchors",
            since="1.1.0",
        ),
    )
    anchor_asymmetry_mm: float = field(
        default=NAN,
        metadata=column(
            _NUMBER,
            "rms distance of each anchor from the mirror image of its partner",
            check="anchors",
            since="1.1.0",
        ),
    )
    anchor_way: str = field(
        default="head",
        metadata=column(
            _TEXT,
            "; ".join(f"{way}: {meaning}" for way, meaning in WAYS.items()),
            check="anchors",
            since="1.2.0",
        ),
    )
    scene_camera: tuple[float, ...] = field(
        default=(),
        metadata=column(
            list_of(_NUMBER),
            "of a head in a Blender scene, the scene's own camera: lens, sensor width and height (mm), which "
            "side it fits (0 the longer, 1 width, 2 height), shifts, height of a pixel over its width, width "
            "and height of the scene's images, and the head's pivot in frame C (mm); else empty",
            check="camera",
            since="1.5.0",
        ),
    )
    vertices: int = field(metadata=column(_COUNT, "of the mesh"))
    triangles: int = field(metadata=column(_COUNT, "of the mesh"))
    problems: tuple[str, ...] = field(
        default=(),
        metadata=column(list_of(_TEXT), "what was wrong but did not stop the head from being built"),
    )
    split: str = field(metadata=column(_TEXT, "train or validation", check="identity"))

    @property
    def own_camera(self) -> SceneCamera | None:
        """The scene's own camera. Raises ValueError: its numbers are none."""
        return SceneCamera.of_numbers(self.scene_camera) if self.scene_camera else None

    def camera(self, resolution: int) -> Camera:
        """The camera that saw this head."""
        return Camera.square(resolution, self.lens_mm, self.distance_mm, self.projection)


HEADS: dict[str, Column] = {
    f.name: Column(f.name, default=None if f.default is MISSING else f.default, **f.metadata)
    for f in fields(HeadRow)
}
"""Every column of heads.parquet by its name, in the order of the table."""


def heads_schema(schema_version: str = SCHEMA_VERSION) -> pa.Schema:
    """The schema of heads.parquet; of an earlier version: with only the columns of its time."""
    known = [column.field(FACE_MESH) for column in columns_at(HEADS, schema_version)]
    return pa.schema(known, metadata={"headturn.schema_version": schema_version})


def write_heads(heads: Sequence[HeadRow], root: Path) -> None:
    """Write heads.parquet, sorted by subject and expression. Raises DatasetError if it cannot."""
    rows = [_as_dict(head) for head in sorted(heads, key=lambda head: (head.subject, head.expression))]
    _write(pa.Table.from_pylist(rows, schema=heads_schema()), root)


def copy_heads(source: Path, chosen: Collection[tuple[str, str]], target: Path) -> None:
    """Write the chosen (subject, expression) of source's heads.parquet into target, as today's columns
    and with those of a later schema that we do not know. Raises DatasetError as :func:`read_heads` does."""
    heads = [head for head in read_heads(source) if (head.subject, head.expression) in chosen]
    stored = _read(dataset_file(source, HEADS_FILE))
    if not is_newer(schema_version_of(stored.schema)):
        write_heads(heads, target)
        return
    names = zip(*(stored.column(name).to_pylist() for name in ("subject", "expression")), strict=True)
    _write(stored.filter(pa.array([name in chosen for name in names])), target)


def read_heads(root: Path) -> list[HeadRow]:
    """The heads of a dataset, in the order of the file; what an older one lacks holds its default.

    Raises DatasetError: the file is missing, damaged, of another version, or names a head twice.
    """
    path = dataset_file(root, HEADS_FILE)
    table = _read(path)
    version = schema_version_of(table.schema)
    expected = heads_schema(version)
    known = table.select([name for name in table.schema.names if name in HEADS])
    if not (known if is_newer(version) else table).schema.equals(expected):
        raise DatasetError(f"{path}: not the columns of a table of heads; run `headturn build` again")
    heads = [_from_dict(row) for row in known.to_pylist()]
    check_head_texts(((head.subject, head.expression, head.split) for head in heads), path)
    for head in heads:
        _check_files(head, path)
    if len({(head.subject, head.expression) for head in heads}) < len(heads):
        raise DatasetError(f"{path}: a head is there twice; run `headturn build` again")
    return heads


def heads_version(root: Path) -> str:
    """The schema version of heads.parquet. Raises DatasetError as :func:`read_heads` does."""
    return schema_version_of(_read(dataset_file(root, HEADS_FILE)).schema)


def _read(path: Path) -> pa.Table:
    try:
        table = read_table(path)
        table.validate(full=True)  # Parquet says that a text is UTF-8, and need not be right
    except (OSError, pa.ArrowException, ValueError) as error:
        raise DatasetError(
            f"{path}: cannot be read ({one_line(error)}); run `headturn build` again"
        ) from error
    check_schema_version(schema_version_of(table.schema), str(path))
    return table


def _write(table: pa.Table, root: Path) -> None:
    write_atomically(
        root / HEADS_FILE,
        lambda file: pq.write_table(table, file, compression="zstd", write_page_checksum=True),
        lambda _: None,
    )


def _check_files(head: HeadRow, where: Path) -> None:
    named = [(head.mesh_path, False), *((path, head.source == SCENE) for path, _ in head.file_sha256)]
    for path, above in named:
        if problem := source_path_problem(path, above=above):
            raise DatasetError(f"{where}: the file {quoted(path)} of {head.subject} {problem}")


def _as_dict(head: HeadRow) -> dict[str, Any]:
    values = {name: getattr(head, name) for name in HEADS}
    values["file_sha256"] = [{"path": path, "sha256": sha256} for path, sha256 in head.file_sha256]
    return values


def _from_dict(values: dict[str, Any]) -> HeadRow:
    files = tuple((file["path"], file["sha256"]) for file in values["file_sha256"])
    lists = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
    return HeadRow(**{**values, **lists, "file_sha256": files})

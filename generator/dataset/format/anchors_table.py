# SPDX-License-Identifier: GPL-3.0-or-later
"""anchors.parquet: where on each head's mesh the landmarks are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.columns import SCHEMA_VERSION, list_of
from generator.dataset.format.files import one_line, write_atomically
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import heads_version, read_heads
from generator.dataset.format.parquet import read_table
from generator.dataset.format.schema import check_schema_version, is_newer, schema_version_of
from generator.errors import DatasetError
from generator.landmarks.topology import FACE_MESH

ANCHORS_FILE = "anchors.parquet"
ANCHORS_SINCE = "1.1.0"
"""The schema version it came in."""


@dataclass(frozen=True, eq=False)
class HeadAnchors:
    """The anchors of one head.

    triangles  int32 [P], index into the mesh's triangles as read; -1 where there is none
    weights    float64 [P, 3], barycentric, of the triangle's corners in its order
    points     float64 [P, 3], mm, frame C at pose zero, pivot at the origin: what
               ``landmarks_exact`` turns; NaN where there is none
    """

    subject: str
    expression: str
    triangles: np.ndarray
    weights: np.ndarray
    points: np.ndarray


def no_head_anchors(subject: str, expression: str, count: int = FACE_MESH.count) -> HeadAnchors:
    """Those of a head that has none. count: points."""
    nothing = np.full((count, 3), np.nan)
    return HeadAnchors(subject, expression, np.full(count, -1, dtype=np.int32), nothing, nothing)


def anchors_schema(count: int) -> pa.Schema:
    """The schema of anchors.parquet for so many points a head."""
    kinds = {
        "subject": pa.string(),
        "expression": pa.string(),
        "triangles": list_of(pa.int32(), count),
        "weights": list_of(pa.float64(), count * 3),
        "points": list_of(pa.float64(), count * 3),
    }
    fields = [pa.field(name, kind, nullable=False) for name, kind in kinds.items()]
    return pa.schema(fields, metadata={"headturn.schema_version": SCHEMA_VERSION})


def write_anchors(anchors: Sequence[HeadAnchors], root: Path) -> None:
    """Write anchors.parquet, sorted by subject and expression. Raises DatasetError if it cannot."""
    ordered = sorted(anchors, key=lambda a: (a.subject, a.expression))
    schema = anchors_schema(len(ordered[0].triangles))
    columns: list[pa.Array] = [
        pa.array([a.subject for a in ordered], pa.string()),
        pa.array([a.expression for a in ordered], pa.string()),
    ]
    for name, number in (("triangles", np.int32), ("weights", np.float64), ("points", np.float64)):
        flat = np.concatenate([np.asarray(getattr(a, name)).reshape(-1) for a in ordered]).astype(number)
        kind = schema.field(name).type
        columns.append(pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind))
    table = pa.table(columns, schema=schema)
    write_atomically(
        root / ANCHORS_FILE,
        lambda file: pq.write_table(table, file, compression="zstd", write_page_checksum=True),
        lambda _: None,
    )


def read_anchors(root: Path) -> dict[tuple[str, str], HeadAnchors]:
    """The anchors of a dataset by (subject, expression).

    In a dataset older than the table no head has any.
    Raises DatasetError: the file is missing, damaged or of another version.
    """
    path = dataset_file(root, ANCHORS_FILE)
    if not path.is_file() and is_newer(ANCHORS_SINCE, heads_version(root)):
        heads = [(head.subject, head.expression) for head in read_heads(root)]
        return {name: no_head_anchors(*name) for name in heads}
    try:
        table = read_table(path)
        table.validate(full=True)  # Parquet says that a text is UTF-8, and need not be right
    except (OSError, pa.ArrowException, ValueError) as error:
        raise DatasetError(
            f"{path}: cannot be read ({one_line(error)}); run `headturn build` again"
        ) from error
    version = schema_version_of(table.schema)
    check_schema_version(version, str(path))
    count = _points(table.schema)
    expected = anchors_schema(count)
    if is_newer(version):
        table = table.select([name for name in table.schema.names if name in expected.names])
    if not table.schema.equals(expected):
        raise DatasetError(f"{path}: not the columns of a table of anchors; run `headturn build` again")
    arrays = {
        name: table.column(name).combine_chunks().flatten().to_numpy().reshape(len(table), count, values)
        for name, values in (("triangles", 1), ("weights", 3), ("points", 3))
    }
    names = zip(table["subject"].to_pylist(), table["expression"].to_pylist(), strict=True)
    return {
        (subject, expression): HeadAnchors(
            subject,
            expression,
            arrays["triangles"][row, :, 0],
            arrays["weights"][row],
            arrays["points"][row],
        )
        for row, (subject, expression) in enumerate(names)
    }


def _points(schema: pa.Schema) -> int:
    """How many points a head has; 0 where the table does not say."""
    at = schema.get_field_index("triangles")
    known = at >= 0 and pa.types.is_fixed_size_list(schema.field(at).type)
    return schema.field(at).type.list_size if known else 0

# SPDX-License-Identifier: GPL-3.0-or-later
"""anchors.parquet: where on each head's mesh the 468 landmarks are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.files import one_line, write_atomically
from generator.dataset.format.schema import LANDMARKS, SCHEMA_VERSION, check_schema_version
from generator.errors import DatasetError

ANCHORS_FILE = "anchors.parquet"


@dataclass(frozen=True, eq=False)
class HeadAnchors:
    """The anchors of one head.

    triangles  int32 [468], index into the mesh's triangles as read; -1 where there is none
    weights    float64 [468, 3], barycentric, of the triangle's corners in its order
    points     float64 [468, 3], mm, frame C at pose zero, pivot at the origin: what
               ``landmarks_exact`` turns; NaN where there is none
    """

    subject: str
    expression: str
    triangles: np.ndarray
    weights: np.ndarray
    points: np.ndarray


def _list(kind: pa.DataType, size: int) -> pa.DataType:
    return pa.list_(pa.field("element", kind, nullable=False), size)


ANCHORS_SCHEMA = pa.schema(
    [
        pa.field("subject", pa.string(), nullable=False),
        pa.field("expression", pa.string(), nullable=False),
        pa.field("triangles", _list(pa.int32(), LANDMARKS), nullable=False),
        pa.field("weights", _list(pa.float64(), LANDMARKS * 3), nullable=False),
        pa.field("points", _list(pa.float64(), LANDMARKS * 3), nullable=False),
    ],
    metadata={"headturn.schema_version": SCHEMA_VERSION},
)


def write_anchors(anchors: Sequence[HeadAnchors], root: Path) -> None:
    """Write anchors.parquet, sorted by subject and expression. Raises DatasetError if it cannot."""
    ordered = sorted(anchors, key=lambda a: (a.subject, a.expression))
    columns: list[pa.Array] = [
        pa.array([a.subject for a in ordered], pa.string()),
        pa.array([a.expression for a in ordered], pa.string()),
    ]
    for name, number in (("triangles", np.int32), ("weights", np.float64), ("points", np.float64)):
        flat = np.concatenate([np.asarray(getattr(a, name)).reshape(-1) for a in ordered]).astype(number)
        kind = ANCHORS_SCHEMA.field(name).type
        columns.append(pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind))
    table = pa.table(columns, schema=ANCHORS_SCHEMA)
    write_atomically(
        root / ANCHORS_FILE,
        lambda file: pq.write_table(table, file, compression="zstd", write_page_checksum=True),
        lambda _: None,
    )


def read_anchors(root: Path) -> dict[tuple[str, str], HeadAnchors]:
    """The anchors of a dataset by (subject, expression).

    Raises DatasetError: the file is missing, damaged or of another version.
    """
    path = root / ANCHORS_FILE
    try:
        table = pq.read_table(path, page_checksum_verification=True)
    except (OSError, pa.ArrowException, ValueError) as error:
        raise DatasetError(
            f"{path}: cannot be read ({one_line(error)}); run `headturn build` again"
        ) from error
    version = (table.schema.metadata or {}).get(b"headturn.schema_version", b"none").decode(errors="replace")
    check_schema_version(version, str(path))
    if not table.schema.equals(ANCHORS_SCHEMA):
        raise DatasetError(f"{path}: not the columns of a table of anchors; run `headturn build` again")
    arrays = {
        name: table.column(name).combine_chunks().flatten().to_numpy().reshape(len(table), LANDMARKS, -1)
        for name in ("triangles", "weights", "points")
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

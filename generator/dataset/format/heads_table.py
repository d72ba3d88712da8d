# SPDX-License-Identifier: GPL-3.0-or-later
"""heads.parquet: where every head comes from, how it was placed, what one may do with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.files import one_line, write_atomically
from generator.dataset.format.schema import LANDMARKS, SCHEMA_VERSION, check_schema_version
from generator.errors import DatasetError
from generator.geometry.camera import Camera, Projection

HEADS_FILE = "heads.parquet"
IDENTITY = tuple(np.eye(3).reshape(-1).tolist())


@dataclass(frozen=True)
class HeadRow:
    """One head of the dataset.

    mesh_path: relative to the root of its source, with "/".
    file_sha256: (path, sha256) of every file that decides the result, paths as mesh_path.
    mm_per_unit: millimetres in one unit of the mesh. up, forward: its axes, such as "+Y" and "+Z".
    pivot: centre of the rotation in the mesh's own units and axes.
    radius_mm: of the sphere about the pivot that holds the face.
    distance_mm, lens_mm: camera to pivot, and focal length on a 36 mm sensor.
    projection: "perspective" or "orthographic".
    frame: where pose zero is, "source" (the mesh's own axes) or "canonical" (levelled).
    correction: R_U, row-major, that turns the mesh from its own axes (after up and forward) to
        the canonical pose zero; it was applied only where frame is "canonical".
    correction_sd_deg: how sure it is, about the axes of yaw, pitch and roll; NaN where no face was found.
    anchor_views: detections that the anchors are the mean of. anchor_off: points that fell off
        the silhouette and lie on the nearest surface. anchor_absent: points without an anchor,
        NaN in landmarks_exact.
    anchor_residual_px: root mean square distance of the detections from the projected anchors, in
        pixels of views 384 wide. anchor_residual_mm: median distance on the surface.
        anchor_asymmetry_mm: rms distance of each anchor from the mirror image of its partner.
        NaN without anchors.
    problems: what was wrong but did not stop the head from being built.
    """

    subject: str
    expression: str
    source: str
    mesh_path: str
    file_sha256: tuple[tuple[str, str], ...]
    license: str
    redistributable: bool
    attribution: str
    units: str
    mm_per_unit: float
    up: str
    forward: str
    pivot: tuple[float, float, float]
    radius_mm: float
    distance_mm: float
    lens_mm: float
    vertices: int
    triangles: int
    split: str
    projection: Projection = "perspective"
    frame: str = "source"
    correction: tuple[float, ...] = IDENTITY
    correction_sd_deg: tuple[float, ...] = (float("nan"),) * 3
    anchor_views: int = 0
    anchor_off: int = 0
    anchor_absent: int = LANDMARKS
    anchor_residual_px: float = float("nan")
    anchor_residual_mm: float = float("nan")
    anchor_asymmetry_mm: float = float("nan")
    problems: tuple[str, ...] = ()

    def camera(self, resolution: int) -> Camera:
        """The camera that saw this head."""
        return Camera.square(resolution, self.lens_mm, self.distance_mm, self.projection)


def _list(kind: pa.DataType, size: int = -1) -> pa.DataType:
    return pa.list_(pa.field("element", kind, nullable=False), size)


_FILE = pa.struct(
    [pa.field("path", pa.string(), nullable=False), pa.field("sha256", pa.string(), nullable=False)]
)

HEADS_SCHEMA = pa.schema(
    [
        pa.field(name, kind, nullable=False)
        for name, kind in (
            ("subject", pa.string()),
            ("expression", pa.string()),
            ("source", pa.string()),
            ("mesh_path", pa.string()),
            ("file_sha256", _list(_FILE)),
            ("license", pa.string()),
            ("redistributable", pa.bool_()),
            ("attribution", pa.string()),
            ("units", pa.string()),
            ("mm_per_unit", pa.float64()),
            ("up", pa.string()),
            ("forward", pa.string()),
            ("pivot", _list(pa.float64(), 3)),
            ("radius_mm", pa.float64()),
            ("distance_mm", pa.float64()),
            ("lens_mm", pa.float64()),
            ("projection", pa.string()),
            ("frame", pa.string()),
            ("correction", _list(pa.float64(), 9)),
            ("correction_sd_deg", _list(pa.float64(), 3)),
            ("anchor_views", pa.int32()),
            ("anchor_off", pa.int32()),
            ("anchor_absent", pa.int32()),
            ("anchor_residual_px", pa.float64()),
            ("anchor_residual_mm", pa.float64()),
            ("anchor_asymmetry_mm", pa.float64()),
            ("vertices", pa.int32()),
            ("triangles", pa.int32()),
            ("problems", _list(pa.string())),
            ("split", pa.string()),
        )
    ],
    metadata={"headturn.schema_version": SCHEMA_VERSION},
)


def write_heads(heads: Sequence[HeadRow], root: Path) -> None:
    """Write heads.parquet, sorted by subject and expression. Raises DatasetError if it cannot."""
    rows = [_as_dict(head) for head in sorted(heads, key=lambda head: (head.subject, head.expression))]
    table = pa.Table.from_pylist(rows, schema=HEADS_SCHEMA)
    write_atomically(
        root / HEADS_FILE,
        lambda file: pq.write_table(table, file, compression="zstd", write_page_checksum=True),
        lambda _: None,
    )


def read_heads(root: Path) -> list[HeadRow]:
    """The heads of a dataset, in the order of the file.

    Raises DatasetError: the file is missing, damaged, of another version, or names a head twice.
    """
    path = root / HEADS_FILE
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        rows = table.to_pylist()
    except (OSError, pa.ArrowException, ValueError) as error:
        raise DatasetError(
            f"{path}: cannot be read ({one_line(error)}); run `headturn build` again"
        ) from error
    version = (table.schema.metadata or {}).get(b"headturn.schema_version", b"none").decode(errors="replace")
    check_schema_version(version, str(path))
    if not table.schema.equals(HEADS_SCHEMA):
        raise DatasetError(f"{path}: not the columns of a table of heads; run `headturn build` again")
    heads = [_from_dict(row) for row in rows]
    if len({(head.subject, head.expression) for head in heads}) < len(heads):
        raise DatasetError(f"{path}: a head is there twice; run `headturn build` again")
    return heads


def _as_dict(head: HeadRow) -> dict[str, Any]:
    values = {field.name: getattr(head, field.name) for field in fields(head)}
    values["file_sha256"] = [{"path": path, "sha256": sha256} for path, sha256 in head.file_sha256]
    return values


def _from_dict(values: dict[str, Any]) -> HeadRow:
    files = tuple((file["path"], file["sha256"]) for file in values["file_sha256"])
    lists = {name: tuple(values[name]) for name in ("pivot", "correction", "correction_sd_deg", "problems")}
    return HeadRow(**{**values, **lists, "file_sha256": files})

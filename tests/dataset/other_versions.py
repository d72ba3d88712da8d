# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset of today's schema rewritten as one of another 1.x, with nothing of ours but its digest."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.columns import ROWS, Column, columns_at, list_of
from generator.dataset.format.heads_table import HEADS
from generator.dataset.format.manifest import configuration_digest, read_manifest, write_manifest
from generator.dataset.format.part import check_part
from generator.sealed import sealed

# As commit 95c4e57 had them.
ROWS_1_0 = (
    "sample_id", "subject", "expression", "split", "head_license", "redistributable", "yaw_deg", "pitch_deg",
    "roll_deg", "yaw_index", "pitch_index", "roll_index", "rotation", "quaternion", "camera",
    "translation_mm", "detected", "landmarks", "width", "height", "image_path", "image_sha256",
)  # fmt: skip
HEADS_1_0 = (
    "subject", "expression", "source", "mesh_path", "file_sha256", "license", "redistributable",
    "attribution", "units", "mm_per_unit", "up", "forward", "pivot", "radius_mm", "distance_mm", "lens_mm",
    "correction", "vertices", "triangles", "problems", "split",
)  # fmt: skip
CONVENTIONS_1_0 = (
    "frame", "rotation", "angles", "signs", "quaternion", "camera", "translation", "landmarks",
)  # fmt: skip


def as_schema_1_0(root: Path) -> Path:
    """Its rows without projection, exact landmarks and passes; heads without anchors; no anchors.parquet."""

    def older(table: pa.Table) -> pa.Table:
        there = [*ROWS_1_0, *(["image"] if "image" in table.schema.names else [])]
        conventions = json.loads(table.schema.metadata[b"headturn.conventions"])
        facts = {
            b"headturn.schema_version": b"1.0.0",
            b"headturn.conventions": json.dumps({k: conventions[k] for k in CONVENTIONS_1_0}).encode(),
            b"headturn.configuration_digest": digest.encode(),  # of all of it
        }
        return table.select(there).replace_schema_metadata({**table.schema.metadata, **facts})

    configuration = read_manifest(root).configuration
    digest = configuration_digest(configuration)
    _rewrite(root, "1.0.0", older, lambda heads: heads.select(list(HEADS_1_0)))
    return root


def as_schema_1_1(root: Path) -> Path:
    """Without the columns that came after 1.1, of rows and of heads."""

    def known(table: pa.Table, columns: Mapping[str, Column]) -> pa.Table:
        names = {column.name for column in columns_at(columns, "1.1.0")}
        return table.select([name for name in table.schema.names if name in names])

    def older(table: pa.Table) -> pa.Table:
        rows = known(table, ROWS)
        return rows.replace_schema_metadata({**rows.schema.metadata, b"headturn.schema_version": b"1.1.0"})

    _rewrite(root, "1.1.0", older, lambda heads: known(heads, HEADS))
    return root


def as_schema_1_9(root: Path) -> Path:
    """With columns that nobody knows yet: in the rows, of the heads, and a key in the manifest."""

    def newer(table: pa.Table) -> pa.Table:
        gaze = pa.FixedSizeListArray.from_arrays(
            pa.array(np.arange(2.0 * len(table))), type=list_of(pa.float64(), 2)
        )
        table = table.add_column(5, pa.field("gaze", list_of(pa.float64(), 2), nullable=False), gaze)
        return table.replace_schema_metadata({**table.schema.metadata, b"headturn.schema_version": b"1.9.0"})

    def heads(table: pa.Table) -> pa.Table:
        return table.append_column(
            pa.field("hat", pa.string(), nullable=False), pa.array(["none"] * len(table))
        )

    _rewrite(root, "1.9.0", newer, heads)
    values = json.loads((root / "manifest.json").read_text(encoding="utf-8"))
    values["weather"] = {"sun": True}
    values["parts"] = [{**part, "mood": "good"} for part in values["parts"]]
    (root / "manifest.json").write_text(json.dumps(sealed(values)), encoding="utf-8")
    return root


Change = Callable[[pa.Table], pa.Table]


def _rewrite(root: Path, version: str, rows: Change, heads: Change) -> None:
    manifest = read_manifest(root)
    for part in manifest.parts:
        pq.write_table(rows(pq.read_table(root / part.path)), root / part.path, write_page_checksum=True)
    table = pq.read_table(root / "heads.parquet")
    table = heads(table).replace_schema_metadata({b"headturn.schema_version": version.encode()})
    pq.write_table(table, root / "heads.parquet")
    if version == "1.0.0":
        (root / "anchors.parquet").unlink()
    parts = tuple(check_part(root / part.path) for part in manifest.parts)
    write_manifest(replace(manifest, parts=parts, schema_version=version), root)

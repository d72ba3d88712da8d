# SPDX-License-Identifier: GPL-3.0-or-later
"""Damage to a dataset, and what verify says of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.part import check_part, read_part
from generator.dataset.proof.verify import VerifyReport

PART = "data/train/part-s1-0.parquet"


def failures(report: VerifyReport) -> dict[str, str]:
    assert all("\n" not in check.detail and "Traceback" not in check.detail for check in report.checks)
    return {check.name: check.detail for check in report.checks if not check.ok}


def rewrite(root: Path, change: dict[str, list], *, honest: bool, part: str = PART) -> None:
    """Change columns of one part; honest = the manifest is made to agree with the new file."""
    table = read_part(root / part)
    for name, values in change.items():
        field = table.schema.field(name)
        table = table.set_column(table.schema.get_field_index(name), field, pa.array(values, type=field.type))
    pq.write_table(table, root / part)
    if honest:
        manifest = read_manifest(root)
        parts = tuple(check_part(root / p.path) if p.path == part else p for p in manifest.parts)
        write_manifest(replace(manifest, parts=parts), root)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that are already there under another name: of a smaller grid."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import SCHEMA_VERSION
from generator.dataset.format.part import part_schema_of, read_part, write_part
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import NO_VERSION, schema_version_of
from generator.errors import DatasetError
from generator.execution.build.receipts import Receipts
from generator.messages import BuildOrder
from generator.plan.factors import PART_FOLDERS, part_folder
from generator.plan.poses import ANGLES


def carry_over(orders: Iterable[BuildOrder], root: Path, receipts: Receipts) -> int:
    """Give units that are there under an earlier name their own, without rendering. Returns how many.

    Where the grid grew, the places in it are rewritten. The part under the earlier name stays; nobody
    needs it any more. Raises DatasetError if a part cannot be written.
    """
    carried = 0
    for order in orders:
        if not order.earlier_units or (root / order.part_path).exists():
            continue
        for earlier in order.earlier_paths:
            if part := receipts.valid_part(earlier, order):
                receipts.add(_renamed(order, part, root), order)
                carried += 1
                break
    return carried


def earlier_parts(orders: Sequence[BuildOrder]) -> set[str]:
    """Where the parts lie that :func:`carry_over` reads, relative to the dataset."""
    return {path for order in orders for path in order.earlier_paths}


def check_schema_of_parts(root: Path) -> None:
    """Raises DatasetError if the parts that are there are of another schema: two make no dataset."""
    parts = [sorted((root / folder).rglob("part-*.parquet")) for folder in PART_FOLDERS]
    for path in [file for files in parts for file in files]:
        try:
            schema = part_schema_of(path)
        except DatasetError:
            continue  # the build will find it damaged and build it again
        found = schema_version_of(schema)
        if found == NO_VERSION:
            continue  # damaged, too
        if found != SCHEMA_VERSION:
            raise DatasetError(
                f"{root}: its rows are of schema {found}, a build adds rows of {SCHEMA_VERSION}; "
                f"run `headturn upgrade {root}` first, or choose another --out"
            )
        return


def _renamed(order: BuildOrder, part: PartInfo, root: Path) -> PartInfo:
    table = read_part(root / part.path)
    indices = np.array(order.indices, dtype=np.int16)
    there = np.stack([table.column(f"{angle}_index").to_numpy() for angle in ANGLES], axis=-1)
    if np.array_equal(there, indices):
        _link(root / part.path, root / order.part_path)
        return replace(part, path=order.part_path)
    for axis, angle in enumerate(ANGLES):
        at = table.schema.get_field_index(f"{angle}_index")
        table = table.set_column(at, table.schema.field(at), pa.array(indices[:, axis]))
    return write_part(table, root, order.split, order.unit, part_folder(order.factor))


def _link(path: Path, target: Path) -> None:
    """A second name for a file, or a copy where the disk has no such thing."""
    try:
        os.link(path, target)
    except OSError:
        half = target.with_name(f".{target.stem}.tmp")
        shutil.copy2(path, half)
        os.replace(half, target)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Is the part that lies there what an order would make? Asked of parts that no receipt vouches for."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import cast

import numpy as np

from generator import registries
from generator.dataset.format.columns import ImageMode
from generator.dataset.format.part import check_part, iter_part, part_schema_of
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import image_path, part_schema, passes_path, sample_id
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.row_checks import row_checks
from generator.errors import DatasetError
from generator.messages import BuildOrder
from generator.plan.factors import row_name
from generator.plan.poses import pose_name

_VERSIONS = b"headturn.versions"
"""What of a part's metadata a resumed build may differ in: the release."""

_OF_TABLES = "identity"
"""The check that compares rows with heads.parquet and poses.csv, which an unfinished build has not."""


def row_names(order: BuildOrder) -> list[str]:
    """The last part of the sample_id of each row of a unit."""
    return [row_name(pose_name(*view.pose), order.factor) for view in order.views]


def unit_files(order: BuildOrder) -> list[str]:
    """Files that a unit's part vouches for, relative to the dataset: its images and its passes."""
    names = (order.head.subject, order.head.expression)
    poses = row_names(order)
    files = []
    if order.images == "files":
        files += [image_path(*names, pose, f".{order.image_format}") for pose in poses]
    if order.passes:
        files += [passes_path(*names, pose) for pose in poses]
    return files


def check_unit(root: Path, path: str, order: BuildOrder) -> PartInfo:
    """Read a part and its files from end to end and compare every row with the order.

    path: of the part, relative to the dataset root; it may have an earlier name than the order's.

    Raises
    ------
    DatasetError: the part cannot be read, is another unit's, or a file of it is not the one it was.
    """
    file = root / path
    info = check_part(file)
    problem = next(_problems(root, file, order), None)
    if problem is not None:
        raise DatasetError(f"{path}: {problem}")
    return info


def _problems(root: Path, file: Path, order: BuildOrder) -> Iterator[str]:
    stored = part_schema_of(file)
    if stored.metadata is None:
        yield "says nothing about its dataset"
        return
    topology = registries.DETECTORS.get(order.landmarks.detector).topology
    images, twins = cast(ImageMode, order.images), bool(order.factor)
    expected_schema = part_schema(
        images, {}, order.configuration_digest, topology, twins=twins, also=order.landmarks.also
    )
    if not stored.equals(expected_schema):
        yield "has other columns than a part of this dataset"
        return
    expected, said = ({**schema.metadata, _VERSIONS: b""} for schema in (expected_schema, stored))
    if expected != said:
        yield "belongs to a dataset of another configuration"
        return
    head = order.head
    rows = iter(
        (sample_id(head.subject, head.expression, name), order.split, head.license)
        for name in row_names(order)
    )
    checks = {name: check for name, check in row_checks().items() if name != _OF_TABLES}
    start = 0
    for batch in iter_part(file):
        named = zip(
            *(batch.column(name).to_pylist() for name in ("sample_id", "split", "head_license")), strict=True
        )
        if list(named) != list(islice(rows, len(batch))):
            yield "holds rows of another head or of other poses"
            return
        context = _context(root, order, start, len(batch))
        for check in checks.values():
            yield from check(batch, context)
        start += len(batch)
    if start < len(order.views):
        yield f"has {start} rows, expected {len(order.views)}"


def _context(root: Path, order: BuildOrder, start: int, count: int) -> RowContext:
    """What rows of an order are compared with: one head, at the poses of the order."""
    return RowContext(
        root=root,
        images=cast(ImageMode, order.images),
        anchors=order.anchors[None],
        expected_view=lambda _, pose: order.views[pose],
        split=order.split,
        head_index=np.zeros(count, np.int32),
        pose_index=np.arange(start, start + count, dtype=np.int32),
    )

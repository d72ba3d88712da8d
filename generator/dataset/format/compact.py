# SPDX-License-Identifier: GPL-3.0-or-later
"""Many small parts to a few large ones: a new dataset with the same rows and the same digest."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Protocol

from generator.dataset.format.build_files import (
    FIRST_PLACED_FILE,
    LOG_FILE,
    PLACED_FILE,
    RECEIPTS_FILE,
)
from generator.dataset.format.digest import add_digests
from generator.dataset.format.files import write_atomically
from generator.dataset.format.folders import folder_beside, share_files
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.manifest import (
    CONFIG_FILE,
    MANIFEST_FILE,
    Manifest,
    read_manifest,
    write_manifest,
)
from generator.dataset.format.part import (
    check_part,
    iter_checked,
    part_schema_of,
    part_writer,
    row_groups,
)
from generator.dataset.format.part_info import PartInfo
from generator.errors import DatasetError
from generator.plan.factors import PART_FOLDERS

TARGET_BYTES = 256 * 10**6

_MERGED = (
    *(*PART_FOLDERS, MANIFEST_FILE, CONFIG_FILE),
    *(RECEIPTS_FILE, PLACED_FILE, FIRST_PLACED_FILE, LOG_FILE),
)
"""What of a dataset's folder is written anew, or belongs to its build: the new one cannot be built on."""


class Progress(Protocol):
    """Where the work says how far it is."""

    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...


def compact_dataset(
    source: Path, target: Path, part_bytes: int = TARGET_BYTES, *, reporter: Progress
) -> Manifest:
    """Write the dataset source again into the new folder target, in parts of about part_bytes.

    Images are linked where both folders are on one disk, else copied.
    The new folder appears only when it is complete. Returns its manifest.

    Raises
    ------
    DatasetError: source is not finished or damaged, target exists, or it cannot be written.
    """
    source, target = source.absolute(), target.absolute()
    manifest = read_manifest(source)
    with folder_beside(source, target) as work:
        parts = []
        reporter.stage("compacting", len(manifest.parts) + len(manifest.twins))
        groups = (*_groups(manifest.parts, part_bytes), *_groups(manifest.twins, part_bytes))
        for number, group in enumerate(groups):
            parts.append(_merge(source, work, group, number))
            reporter.advance(len(group))
        share_files(source, work, _MERGED)
        compacted = replace(
            manifest,
            parts=tuple(part for part in parts if not part.of_twins),
            twins=tuple(part for part in parts if part.of_twins),
        )
        if (compacted.digest, compacted.twins_digest) != (manifest.digest, manifest.twins_digest):
            raise DatasetError(f"{source}: its parts differ from its manifest; see `headturn verify`")
        write_manifest(compacted, work)
    return read_manifest(target)


def _groups(every: Sequence[PartInfo], part_bytes: int) -> Iterator[list[PartInfo]]:
    """Parts of one split that make up one new part, in the order of head and place."""
    for split in sorted({part.path.split("/")[1] for part in every}):
        parts = [part for part in every if part.path.split("/")[1] == split]
        group: list[PartInfo] = []
        size = 0
        for part in sorted(parts, key=lambda part: (part.subject, part.expression, part.path)):
            if group and size + part.bytes > part_bytes:
                yield group
                group, size = [], 0
            group.append(part)
            size += part.bytes
        yield group


def _merge(source: Path, work: Path, group: Sequence[PartInfo], number: int) -> PartInfo:
    folder, split, _ = group[0].path.split("/")
    name = hashlib.sha256("".join(part.digest for part in group).encode()).hexdigest()[:16]
    path = work / folder / split / f"part-{number:05d}-{name}.parquet"
    schema = part_schema_of(dataset_file(source, group[0].path))

    def write(file: BinaryIO) -> None:
        with part_writer(file, schema) as writer:
            for part in group:
                for rows in row_groups(iter_checked(dataset_file(source, part.path))):
                    writer.write_table(rows)

    def check(temporary: Path) -> PartInfo:
        info = check_part(temporary)
        if info.digest != add_digests(part.digest for part in group):
            raise DatasetError(f"{path}: what was read back differs from what was merged; check the disk")
        return replace(info, path=f"{folder}/{split}/{path.name}")

    return write_atomically(path, write, check, work)

# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset of an earlier schema rewritten as one of today's: the columns it lacks hold their defaults."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa

from generator.dataset.format.anchors_table import ANCHORS_FILE, read_anchors, write_anchors
from generator.dataset.format.columns import SCHEMA_VERSION
from generator.dataset.format.compact import Progress
from generator.dataset.format.defaults import todays_schema, with_defaults
from generator.dataset.format.digest import NO_ROWS, add_digests, content_digest
from generator.dataset.format.files import write_atomically
from generator.dataset.format.folders import folder_beside, share_files
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import HEADS_FILE, read_heads, write_heads
from generator.dataset.format.manifest import (
    MANIFEST_FILE,
    Manifest,
    configuration_digest,
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
from generator.dataset.format.schema import is_newer
from generator.dataset.show.card import CARD_FILE, write_card
from generator.errors import DatasetError
from generator.plan.factors import PART_FOLDERS
from generator.plan.first_settings import common_values

_REWRITTEN = (*PART_FOLDERS, HEADS_FILE, ANCHORS_FILE, CARD_FILE, MANIFEST_FILE)


@dataclass(frozen=True)
class Upgrade:
    """What was done. before: the schema version that was found; root: where the dataset of today's is."""

    root: Path
    before: str
    manifest: Manifest

    @property
    def changed(self) -> bool:
        """Was there anything to do?"""
        return is_newer(self.manifest.schema_version, self.before)


def upgrade_dataset(source: Path, target: Path | None = None, *, reporter: Progress) -> Upgrade:
    """Rewrite a dataset to today's schema, as the new folder target or in its own place.

    A dataset of today's schema, or of a later one, stays as it is. Its own place is taken only by a
    dataset that is complete, in two renames; if the second was prevented, the next call puts it right.

    Raises
    ------
    DatasetError: source is not finished or damaged, target exists, or it cannot be written.
    """
    if target is None:
        source = source.resolve()
        _put_right(source)
    source = source.absolute()
    manifest = read_manifest(source)
    if not is_newer(SCHEMA_VERSION, manifest.schema_version):
        return Upgrade(source, manifest.schema_version, manifest)
    place = target.absolute() if target else _fresh(source)
    with folder_beside(source, place) as work:
        _write(source, work, manifest, reporter)
    if target is None:
        _swap(source)
        place = source
    return Upgrade(place, manifest.schema_version, read_manifest(place))


def _write(source: Path, work: Path, manifest: Manifest, reporter: Progress) -> None:
    reporter.stage("upgrading", len(manifest.parts) + len(manifest.twins))
    parts = []
    for part in (*manifest.parts, *manifest.twins):
        parts.append(_rewrite(source, work, part, manifest))
        reporter.advance()
    share_files(source, work, _REWRITTEN)
    write_heads(read_heads(source), work)
    write_anchors(list(read_anchors(source).values()), work)
    upgraded = replace(
        manifest,
        parts=tuple(part for part in parts if not part.of_twins),
        twins=tuple(part for part in parts if part.of_twins),
        schema_version=SCHEMA_VERSION,
    )
    write_card(upgraded, work)
    write_manifest(upgraded, work)


def _rewrite(source: Path, work: Path, part: PartInfo, manifest: Manifest) -> PartInfo:
    file = dataset_file(source, part.path)
    stored = part_schema_of(file)
    schema = todays_schema(stored, str(file))
    digest = configuration_digest(common_values(manifest.configuration))
    schema = schema.with_metadata({**schema.metadata, b"headturn.configuration_digest": digest.encode()})
    then, now = [NO_ROWS], [NO_ROWS]

    def batches() -> Iterator[pa.RecordBatch]:
        for batch in iter_checked(file):
            then.append(content_digest(batch))
            new = with_defaults(batch, schema)
            now.append(content_digest(new))
            yield new

    def write(file: BinaryIO) -> None:
        with part_writer(file, schema) as writer:
            for rows in row_groups(batches()):
                writer.write_table(rows)
        if add_digests(then) != part.digest:
            raise DatasetError(
                f"{source / part.path}: holds other values than its manifest says; see `headturn verify`"
            )

    def check(temporary: Path) -> PartInfo:
        info = check_part(temporary)
        if info.digest != add_digests(now):
            raise DatasetError(f"{work / part.path}: what was read back differs from what was written")
        return replace(info, path=part.path)

    return write_atomically(work / part.path, write, check, work)


def _fresh(root: Path) -> Path:
    """Where the upgraded dataset waits for its place; complete if it is there."""
    return root.with_name(f".{root.name}.upgraded")


def _old(root: Path) -> Path:
    """Where the dataset is put that has lost its place."""
    return root.with_name(f".{root.name}.before-upgrade")


def _swap(root: Path) -> None:
    """Put the upgraded dataset into its place, and then remove the other."""
    try:
        root.rename(_old(root))
        _fresh(root).rename(root)
    except OSError as error:
        if not root.exists() and _old(root).exists():
            _old(root).rename(root)
        shutil.rmtree(_fresh(root), ignore_errors=True)
        raise DatasetError(
            f"{root}: cannot take the place of the old one ({error.strerror}); nothing was changed. "
            "Write it beside with --out"
        ) from error
    shutil.rmtree(_old(root), ignore_errors=True)


def _put_right(root: Path) -> None:
    """End a swap that was interrupted: the dataset is in its place, the upgraded one if it is complete."""
    try:
        if not root.exists() and _old(root).exists():
            (_fresh(root) if _fresh(root).exists() else _old(root)).rename(root)
    except OSError as error:
        raise DatasetError(f"{_old(root)}: cannot be renamed to {root} ({error.strerror})") from error
    if root.exists():
        shutil.rmtree(_fresh(root), ignore_errors=True)
        shutil.rmtree(_old(root), ignore_errors=True)

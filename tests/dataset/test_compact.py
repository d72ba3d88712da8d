# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging parts: fewer files, the same rows."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_dataset import build_dataset

from generator.dataset.ablate.ablation import ablate_dataset
from generator.dataset.format.compact import compact_dataset
from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError


class Quiet:
    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...


def test_the_same_rows_in_fewer_files(dataset: Path, tmp_path: Path) -> None:
    before = read_manifest(dataset)
    after = compact_dataset(dataset, tmp_path / "c", reporter=Quiet())
    assert len(after.parts) == len(after.splits) < len(before.parts)
    assert (after.digest, after.rows, after.detected_rows) == (
        before.digest,
        before.rows,
        before.detected_rows,
    )
    report = verify_dataset(tmp_path / "c")
    assert report.ok, report.text()
    assert verify_dataset(dataset).ok
    assert not list(tmp_path.glob(".*"))


def test_twins_are_merged_too(tmp_path: Path) -> None:
    build_dataset(tmp_path / "dataset", twins=("jpeg", "noise"))
    before = read_manifest(tmp_path / "dataset")
    after = compact_dataset(tmp_path / "dataset", tmp_path / "c", reporter=Quiet())
    assert (len(before.twins), len(after.twins)) == (4, 2), "one a split, of both factors"
    assert (after.digest, after.twins_digest) == (before.digest, before.twins_digest)
    report = verify_dataset(tmp_path / "c")
    assert report.ok, report.text()
    before_and_after = [ablate_dataset(tmp_path / name).as_dict() for name in ("dataset", "c")]
    assert before_and_after[0] == before_and_after[1]


def test_parts_keep_to_the_size(dataset: Path, tmp_path: Path) -> None:
    before = read_manifest(dataset)
    after = compact_dataset(dataset, tmp_path / "c", 1, reporter=Quiet())
    assert len(after.parts) == len(before.parts)


def test_a_damaged_part_stops_it_and_nothing_appears(dataset: Path, tmp_path: Path) -> None:
    part = dataset / read_manifest(dataset).parts[0].path
    part.write_bytes(part.read_bytes()[:-100])
    with pytest.raises(DatasetError, match="not a readable part"):
        compact_dataset(dataset, tmp_path / "c", reporter=Quiet())
    assert not list(tmp_path.glob("*c*"))


def test_a_folder_that_is_there_or_inside_is_refused(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    with pytest.raises(DatasetError, match="exists"):
        compact_dataset(dataset, tmp_path / "c", reporter=Quiet())
    with pytest.raises(DatasetError, match="lies inside"):
        compact_dataset(dataset, dataset / "c", reporter=Quiet())

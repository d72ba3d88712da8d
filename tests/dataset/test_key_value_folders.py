# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders called key=value on the path to a dataset, as those who train by the hundred have them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.format.anchors_table import read_anchors, write_anchors
from generator.dataset.format.compact import compact_dataset
from generator.dataset.format.heads_table import read_heads, write_heads
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import read_rows
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.report.page import write_report
from generator.registries import FORMATS

ROOT = Path(__file__).resolve().parents[2]


class Quiet:
    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...


@pytest.fixture(params=["seed=7", "lr=1e-3/subject=x", "split=train/a=b=c"])
def moved(dataset: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    folder = tmp_path / request.param
    folder.mkdir(parents=True)
    return Path(shutil.move(dataset, folder / "ds"))


def test_everything_reads_and_writes_there(moved: Path) -> None:
    report = verify_dataset(moved)
    assert report.ok, report.text()
    assert verify_dataset(moved, quick=True).ok
    manifest = read_manifest(moved)
    subjects = {row for batch in read_rows(moved, manifest.parts) for row in batch["subject"].to_pylist()}
    assert subjects == {"s1", "s2"}
    write_report(moved, moved.parent / "report.html")
    again = compact_dataset(moved, moved.parent / "compact=yes", reporter=Quiet())
    assert again.digest == manifest.digest
    assert verify_dataset(moved.parent / "compact=yes").ok
    write_heads(read_heads(moved), moved.parent)
    write_anchors(list(read_anchors(moved).values()), moved.parent)


@pytest.mark.parametrize("form", list(FORMATS))
def test_every_export(dataset: Path, tmp_path: Path, form: str) -> None:
    folder = tmp_path / "seed=7"
    folder.mkdir()
    export_dataset(Path(shutil.move(dataset, folder / "ds")), form, folder / f"to={form}", ExportOptions())


def test_no_file_is_read_as_a_piece_of_a_partitioned_table() -> None:
    """pyarrow makes columns of such folders unless it is told not to, for single files as well."""
    reads = re.compile(r"\bpq\.read_table\([^\n]*")
    for folder in ("generator", "downstream_hpe", "blender_addon", "benchmarks", "scripts"):
        for path in ROOT.glob(f"{folder}/**/*.py"):
            for call in reads.findall(path.read_text(encoding="utf-8")):
                assert "partitioning=None" in call, f"{path}: {call}"

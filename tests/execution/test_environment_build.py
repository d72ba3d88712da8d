# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole build with environments and backdrops: verified, replayed, and built by another number of lanes."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest
from small_builds import config_for, run

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.execution.replay import replay_samples

pytestmark = pytest.mark.slow

RENDER = {
    "resolution": 96,
    "environment": "all",
    "environment_yaw_deg": "uniform:-180,180",
    "environment_strength": "log-uniform:0.5,2",
    "backdrop": "choice:plain,environment,noise",
}


def test_it_verifies_replays_and_needs_no_order(parametric_heads: Path, tmp_path: Path) -> None:
    config = config_for(parametric_heads, render=RENDER)
    root = tmp_path / "dataset"
    run(config, root)
    report = verify_dataset(root)
    assert report.ok, report.text()
    rows = pq.read_table(root / "data").to_pylist()
    assert len({row["look_environment"] for row in rows}) > 3
    assert {row["look_backdrop"] for row in rows} == {"plain", "environment", "noise"}
    some = [row["sample_id"] for row in rows][::3]
    found = [*replay_samples(root, some, workers=1)]
    assert len(found) == len(some) and all(one.same for one in found), [one.text() for one in found]
    other = run(config, tmp_path / "other", "serial")
    assert other.manifest.digest == read_manifest(root).digest

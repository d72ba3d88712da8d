# SPDX-License-Identifier: GPL-3.0-or-later
"""A real build with two detectors: LiteRT's points beside MediaPipe's, proved and replayed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from small_builds import config_for, run

from generator.dataset.format.open import as_array
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError, WorkerError
from generator.execution.replay import replay_sample
from generator.landmarks.detector import open_detector
from generator.plan.settings import Landmarks

pytestmark = pytest.mark.slow

pytest.importorskip("ai_edge_litert", reason="LiteRT is not installed: pip install ai-edge-litert")


def test_both_are_in_the_table_and_agree(parametric_heads: Path, tmp_path: Path) -> None:
    config = config_for(parametric_heads, landmarks={"also": ["litert"]}, heads={"units": "mm"})
    result = run(config, tmp_path / "d", "serial")
    assert result.manifest.versions["detector"].startswith("mediapipe-face-mesh 0.10.21; litert-468 ")
    report = verify_dataset(tmp_path / "d")
    assert report.ok, report.text()
    rows = pq.read_table(tmp_path / "d" / "data", partitioning=None)
    first, second = (as_array(rows, name) for name in ("landmarks", "landmarks_litert"))
    found = as_array(rows, "detected").astype(bool)
    assert found.any() and np.array_equal(np.isfinite(second).all(axis=(1, 2)), found)
    assert np.abs(second - first)[found].max() < 0.05
    name = rows["sample_id"][0].as_py()
    assert replay_sample(tmp_path / "d", name, heads=parametric_heads).same


def test_a_detector_that_cannot_start_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "face.task").write_text("no zip")
    with pytest.raises(WorkerError, match=r"face\.task: not a readable \.task"):
        open_detector(Landmarks(detector="file", file=str(tmp_path / "face.task")))
    with pytest.raises(UsageError, match="expected one of mediapipe, litert"):
        open_detector(Landmarks(detector="nose"))

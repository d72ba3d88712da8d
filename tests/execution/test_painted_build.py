# SPDX-License-Identifier: GPL-3.0-or-later
"""A build with albedo and segmentation: verified, replayed, and verify notices what was changed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from small_builds import config_for, run

from generator.dataset.format.passes import read_channels
from generator.dataset.proof import pass_checks
from generator.dataset.proof.pass_checks import segmentation_problem
from generator.dataset.proof.verify import verify_dataset
from generator.execution.replay import replay_samples
from generator.plan.passes import SEGMENTATION

pytestmark = pytest.mark.slow


def test_it_verifies_replays_and_knows_the_face(
    parametric_heads: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses = {"yaw": [-30, 30, 60], "pitch": [0, 0, 10], "roll": [0, 0, 10]}
    passes = ["depth", "albedo", "segmentation"]
    root = tmp_path / "dataset"
    run(config_for(parametric_heads, poses=poses, dataset={"passes": passes}), root)
    report = verify_dataset(root)
    assert report.ok, report.text()
    rows = pq.read_table(root / "data").to_pylist()
    [again] = [*replay_samples(root, [rows[0]["sample_id"]], workers=1)]
    assert again.same, again.text()
    plain = tmp_path / "plain"
    run(config_for(parametric_heads, poses=poses), plain)
    theirs = pq.read_table(plain / "data").to_pylist()
    images, alone = ({r["sample_id"]: r["image_sha256"] for r in table} for table in (rows, theirs))
    assert images == alone, "passes change no image"
    with monkeypatch.context() as patched:  # as if somebody had made hashes anew
        patched.setattr(pass_checks, "segmentation_problem", lambda channels: "not so")
        assert "not so" in verify_dataset(root, workers=1).text()
    for row in rows:
        channels = read_channels(root / row["passes_path"])
        exact = np.reshape(row["landmarks_exact"], (468, 3))
        k = np.reshape(row["camera"], (3, 3))
        pixels = (exact / exact[:, 2:]) @ k.T
        visible = np.array(row["landmarks_visible"])
        for place, label in ((17, "lips"), (50, "skin"), (280, "skin"), (105, "brows"), (334, "brows")):
            if visible[place]:
                x, y = np.floor(pixels[place, :2]).astype(int)
                around = channels[f"segmentation.{label}"][y - 2 : y + 3, x - 2 : x + 3]
                assert around.max() > 0.4, (row["sample_id"], place, label)


def test_what_cannot_be_is_said() -> None:
    whole = {name: np.zeros((4, 4), np.float32) for name in SEGMENTATION.channel_names}
    whole["segmentation.skin"][:] = 1
    assert segmentation_problem(whole) == ""
    assert "add up" in segmentation_problem({**whole, "segmentation.hair": np.full((4, 4), 0.2, np.float32)})
    less = {**whole, "segmentation.hair": np.full((4, 4), -0.2, np.float32)}
    assert "below 0" in segmentation_problem(less)
    nothing = {**whole, "segmentation.background": whole["segmentation.skin"]}
    nothing["segmentation.skin"] = whole["segmentation.hair"]
    assert segmentation_problem(nothing) == ""
    assert "nothing where" in segmentation_problem({**nothing, "depth.Z": np.ones((4, 4), np.float32)})

# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's own thing in a dataset: seen, recorded, verified, replayed; a bad one stops before anything."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from small_builds import config_for, run

from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError
from generator.execution.replay import replay_sample

PLATE = "mtllib plate.mtl\nusemtl red\nv -3 -3 4\nv 3 -3 4\nv 3 3 4\nv -3 3 4\nf 1 2 3\nf 1 3 4\n"
"""cm, before a nose whose tip is the origin."""


@pytest.fixture
def things(tmp_path: Path) -> Path:
    """A red plate before the nose."""
    folder = tmp_path / "things"
    folder.mkdir()
    (folder / "plate.obj").write_text(PLATE)
    (folder / "plate.mtl").write_text("newmtl red\nKd 1 0 0\n")
    points = {1: [0, 0, 0], 33: [-4.5, 3.7, -4], 263: [4.5, 3.7, -4], 152: [0, -7.5, -2]}
    said = {
        "label": "occluder",
        "units": "cm",
        "points": [{"landmark": k, "point": place} for k, place in points.items()],
    }
    (folder / "plate.json").write_text(json.dumps(said))
    return folder


@pytest.mark.slow
def test_it_is_seen_recorded_verified_and_replayed(
    parametric_heads: Path, things: Path, tmp_path: Path
) -> None:
    config = config_for(
        parametric_heads,
        render={"things": str(things), "thing": "choice:none,plate"},
        poses={"yaw": [-20, 20, 20], "pitch": [0, 0, 10], "roll": [0, 0, 10]},
    )
    root = tmp_path / "dataset"
    run(config, root, "serial")
    rows = pq.read_table(root / "data").to_pylist()
    assert {row["look_thing"] for row in rows} == {"none", "plate"}
    for row in rows:
        image = np.asarray(Image.open(root / row["image_path"]).convert("RGB"), float)
        red = ((image[..., 0] > 90) & (image[..., 1] < 20) & (image[..., 2] < 20)).sum()
        assert (red > 100) == (row["look_thing"] == "plate") and not row["look_left_out"]
        assert bool(np.array(row["landmarks_visible"])[1]) == (row["look_thing"] == "none")
    assert verify_dataset(root).ok
    plated = next(row for row in rows if row["look_thing"] == "plate")
    assert replay_sample(root, plated["sample_id"]).same
    (things / "plate.mtl").write_text("newmtl red\nKd 0 1 0\n")
    with pytest.raises(UsageError, match="things are others than then"):
        replay_sample(root, plated["sample_id"])


def test_a_bad_mesh_stops_before_anything_is_made(things: Path, tmp_path: Path) -> None:
    (things / "plate.obj").write_text("v 0 0 0\n")
    config = config_for("parametric", render={"things": str(things), "thing": "plate"})
    with pytest.raises(UsageError, match=r"render\.things: .*plate\.obj"):
        run(config, tmp_path / "dataset", "serial")
    assert not (tmp_path / "dataset").exists()

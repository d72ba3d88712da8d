# SPDX-License-Identifier: GPL-3.0-or-later
"""A seed is a look: of a preview, of what the panel shows, and of the row of a build."""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from quiet import Quiet

from generator import cli
from generator.dataset.format.columns import LOOKS
from generator.execution.build.run import build
from generator.execution.executors.open import open_executor
from generator.execution.preview.server import PreviewServer
from generator.plan.config import load_config

POSE, SEED = (20.0, -5.0, 0.0), 7


def test_the_same_seed_is_the_same_look_everywhere(
    parametric_heads: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    head = parametric_heads / "s1p0000"
    render = {"variety": "photo", "resolution": 96, "glasses": "choice:round"}
    (tmp_path / "one.csv").write_text("yaw_deg,pitch_deg,roll_deg\n20,-5,0\n")
    poses = {"kind": "csv", "path": str(tmp_path / "one.csv")}
    given = {"heads": {"source": str(head)}, "render": render}
    config = load_config(None, {**given, "poses": {**poses, "seed": SEED}})
    with open_executor("serial") as lanes:
        build(config, tmp_path / "d", lanes, Quiet())
    [row] = pq.read_table(tmp_path / "d" / "data").to_pylist()
    built = cv2.imread(str(tmp_path / "d" / row["image_path"]))

    options = ["--pose", "20,-5,0", "--variety", "photo", "--seed", SEED, "--preset", "fast", "--json"]
    more = ["--glasses", "choice:round", "--resolution", 96, "--no-landmarks", "--out", tmp_path / "p.png"]
    monkeypatch.setattr(sys, "argv", ["headturn", "preview", *map(str, [head, *options, *more])])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert not ended.value.code
    drawn = json.loads(capsys.readouterr().out)["drawn"]
    assert len(drawn) > 15 and drawn["distance_mm"] == row["translation_mm"][2]
    assert {key: row[name] for name, key in LOOKS.items() if key in drawn} == {
        key: value for key, value in drawn.items() if f"look_{key}" in LOOKS
    }
    assert np.array_equal(cv2.imread(str(tmp_path / "p.png")), built)

    with ExitStack() as stack:
        server = PreviewServer(tmp_path, stack)
        server.answer({"op": "list", "config": given, "made": str(tmp_path / "made")})
        package, subject = str(tmp_path / "head.npz"), row["subject"]
        named = {"subject": subject, "expression": "neutral"}
        placed = server.answer({"op": "place", "config": given, "package": package, **named})
        answer = server.answer(
            {
                "op": "looks",
                "config": given,
                "package": package,
                "head": f"{subject}/neutral",
                "radius_mm": placed["radius_mm"],
                "pose": [*POSE],
                "seeds": [3, SEED, 8],
                "folder": str(tmp_path / "looks"),
                "sheet": 2,
            }
        )
    assert answer["drawn"][1] == drawn != answer["drawn"][0] and drawn["glasses"] == "round"
    assert len(answer["left_out"]) == 3 and answer["left_out"][1] == row["look_left_out"]
    pictures = [cv2.imread(path) for path in answer["pictures"]]
    assert np.array_equal(pictures[1], built)
    assert not np.array_equal(pictures[0], pictures[2])
    sheet = cv2.imread(answer["sheet"])
    assert sheet.shape == (192, 192, 3)
    assert (sheet[:80, 96:] == built[:80]).all(), "beside each other, above the seed's number"
    assert (sheet[80:96, 96:] != built[80:]).any()

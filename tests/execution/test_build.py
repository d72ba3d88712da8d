# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole builds with a real Blender and a real detector, as small as they can be."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from small_builds import Quiet, config_for, run

from generator.dataset.format.manifest import MANIFEST_FILE, read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError, HeadError, UsageError
from generator.execution.build.run import build
from generator.execution.executors.local import LocalExecutor
from generator.execution.executors.open import open_executor
from generator.plan.config import BuildConfig

pytestmark = pytest.mark.slow


def test_a_build_verifies_and_shows_itself(built: tuple[BuildConfig, Path]) -> None:
    _, root = built
    report = verify_dataset(root)
    assert report.ok, report.text()
    assert (root / "contact_sheet.png").stat().st_size > 10_000
    assert (root / "detection_rate.png").stat().st_size > 5_000
    table = pq.read_table(root / "data")
    assert len(table) == 12
    assert table["detected"].to_pylist().count(True) >= 10
    assert len(list((root / "images").rglob("*.png"))) == 12


@pytest.mark.parametrize(("executor", "lanes"), [("serial", {}), ("local", {"workers": 1})])
def test_any_executor_gives_the_same_bytes(
    executor: str, lanes: dict, built: tuple[BuildConfig, Path], tmp_path: Path
) -> None:
    """The one compared with has as many lanes as there are cores."""
    config, root = built
    result = run(config, tmp_path / "dataset", executor, lanes=lanes)
    ours = read_manifest(root)
    assert result.manifest.digest == ours.digest
    assert [p.sha256 for p in result.manifest.parts] == [p.sha256 for p in ours.parts]


def test_a_second_run_builds_only_what_is_missing(built: tuple[BuildConfig, Path], tmp_path: Path) -> None:
    config, root = built
    copy = tmp_path / "copy"
    shutil.copytree(root, copy)
    before = read_manifest(copy)
    (copy / before.parts[1].path).unlink()
    (copy / before.parts[2].path).write_bytes(b"PAR1 cut short")
    (copy / MANIFEST_FILE).unlink()
    reporter = Quiet()
    result = run(config, copy, reporter=reporter)
    assert reporter.stages["rendering"] == before.parts[1].rows + before.parts[2].rows
    assert result.manifest.digest == before.digest
    assert verify_dataset(copy).ok


def test_another_configuration_is_refused_with_what_differs(built: tuple[BuildConfig, Path]) -> None:
    config, root = built
    other = config_for(config.heads.source, render={"resolution": 64})
    with pytest.raises(DatasetError, match=r"render.resolution: 96 -> 64"):
        run(other, root)
    assert verify_dataset(root).ok, "and nothing was touched"


def test_a_folder_that_is_something_else_is_refused(parametric_heads: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("do not overwrite")
    with pytest.raises(DatasetError, match="not empty and not a Headturn dataset"):
        run(config_for(parametric_heads), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_place_that_cannot_be_written_is_one_line(parametric_heads: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DatasetError, match="cannot write"):
        run(config_for(parametric_heads), tmp_path / "file" / "dataset")


def test_one_bad_head_among_many_is_skipped(parametric_heads: Path, tmp_path: Path) -> None:
    heads = tmp_path / "heads"
    shutil.copytree(parametric_heads, heads)
    bad = sorted(p for p in heads.iterdir() if p.is_dir())[0]
    (bad / "neutral.obj").write_text("v 0 0 0\nf 1 2 3\n")
    reporter = Quiet()
    result = run(config_for(heads), tmp_path / "dataset", reporter=reporter)
    assert not result.complete
    assert [s.subject for s in result.skipped] == [bad.name]
    assert "neutral.obj" in result.skipped[0].reason
    assert result.manifest.rows == 6
    assert verify_dataset(tmp_path / "dataset").ok


def test_a_mesh_without_a_face_is_refused(tmp_path: Path) -> None:
    import trimesh

    (tmp_path / "ball").mkdir()
    trimesh.creation.icosphere(radius=100).export(tmp_path / "ball" / "ball.obj")
    with pytest.raises(HeadError, match="no face was found from the front"):
        run(config_for(tmp_path / "ball", heads={"up": "+Y", "forward": "+Z"}), tmp_path / "dataset")
    # Nothing was rendered, so the folder is free for the next try, which says what is wrong with itself.
    with pytest.raises(UsageError, match="nowhere"):
        run(config_for(tmp_path / "nowhere"), tmp_path / "dataset")


def test_axes_and_units_are_found(parametric_heads: Path, tmp_path: Path) -> None:
    """The same head in metres, Z up, facing -Y and far from the origin: the same placement."""
    import json

    import numpy as np

    from generator.dataset.format.heads_table import read_heads

    source = sorted(p for p in parametric_heads.iterdir() if p.is_dir())[0]
    copy = tmp_path / "blenderish"
    shutil.copytree(source, copy)
    (copy / "head.json").unlink()
    lines = []
    for line in (copy / "neutral.obj").read_text().splitlines():
        if line.startswith("v "):
            x, y, z = (float(w) / 1000 for w in line.split()[1:4])
            line = f"v {x + 3:.6f} {-z + 1:.6f} {y - 2:.6f}"
        lines.append(line)
    (copy / "neutral.obj").write_text("\n".join(lines) + "\n")
    assert json.loads((source / "head.json").read_text())["units"] == "mm"
    reporter = Quiet()
    one_pose = {"yaw": [0, 0, 10], "pitch": [0, 0, 10], "roll": [0, 0, 10]}
    run(config_for(copy, poses=one_pose), tmp_path / "a", reporter=reporter)
    run(config_for(source, poses=one_pose), tmp_path / "b")
    [guessed], [known] = read_heads(tmp_path / "a"), read_heads(tmp_path / "b")
    assert (guessed.units, guessed.up, guessed.forward) == ("m", "+Z", "-Y")
    assert any("units guessed: m" in note for note in reporter.notes)
    assert "blenderish/neutral: licence unknown" in reporter.notes
    assert all(any(problem in note for note in reporter.notes) for problem in guessed.problems)
    x, y, z = known.pivot
    assert np.allclose(np.array(guessed.pivot) * 1000, [x + 3000, -z + 1000, y - 2000], atol=2)


def test_a_killed_lane_is_replaced_and_nothing_is_lost(
    built: tuple[BuildConfig, Path], tmp_path: Path
) -> None:
    config, root = built
    reporter = Quiet()
    with open_executor("local", workers=1) as lanes:
        assert isinstance(lanes, LocalExecutor)
        kills = []

        def kill_once() -> None:
            if "rendering" in reporter.stages and not kills:
                lane = lanes._slots[0]._lane
                kills.append(lane._process.pid)
                os.kill(kills[0], signal.SIGKILL)

        reporter.on_frame = kill_once
        result = build(config, tmp_path / "dataset", lanes, reporter)
    assert kills
    assert result.complete
    assert result.manifest.digest == read_manifest(root).digest


@pytest.mark.parametrize("images", ["embedded", "none"])
def test_images_elsewhere(images: str, parametric_heads: Path, tmp_path: Path) -> None:
    one = {"yaw": [0, 0, 10], "pitch": [0, 0, 10], "roll": [0, 20, 20]}
    root = tmp_path / "dataset"
    run(config_for(parametric_heads, dataset={"images": images, "image_format": "jpg"}, poses=one), root)
    assert verify_dataset(root).ok
    assert not (root / "images").exists()
    assert (root / "contact_sheet.png").exists() == (images == "embedded")

# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets that grow, shrink and start over."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_builds import Quiet, config_for, run

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError
from generator.execution.build.chunks import Earlier, assign_chunks, cut
from generator.plan.config import BuildConfig
from generator.plan.pose_plans import PosePlans, poses_csv, read_pose_plans
from generator.plan.poses import csv_plan, grid_plan, uniform_plan

Built = tuple[BuildConfig, Path]


def copy_of(built: Built, root: Path) -> Path:
    shutil.copytree(built[1], root)
    return root


def built_as(config: BuildConfig, root: Path, rendered: int, **options: object) -> None:
    """Build config in root: so many images are rendered, and the dataset is sound."""
    reporter = Quiet()
    run(config, root, reporter=reporter, **options)
    assert reporter.stages["rendering"] == rendered, reporter.notes
    report = verify_dataset(root)
    assert report.ok, report.text()


def test_more_poses_and_heads_are_added_and_taken_away(built: Built, tmp_path: Path) -> None:
    """A grid that grows at both ends renders only what is new; the digest is that of a build in one go."""
    small, root = built[0], copy_of(built, tmp_path / "d")
    first = sorted(path.name for path in Path(small.heads.source).iterdir())[0]
    wide = config_for(small.heads.source, poses={"yaw": [-60, 60, 20]})
    built_as(wide, root, rendered=2 * (14 - 6))
    digest = read_manifest(root).digest

    narrow = config_for(small.heads.source, poses={"yaw": [-60, 60, 20]}, heads={"subjects": [first]})
    with pytest.raises(DatasetError, match=r"4 parts .* will be deleted; nothing was changed"):
        run(narrow, root)
    assert verify_dataset(root).ok
    built_as(narrow, root, rendered=0, confirm=lambda what: True)
    assert [path.name for path in (root / "images").iterdir() if any(path.rglob("*.png"))] == [first]

    built_as(wide, root, rendered=14)
    assert read_manifest(root).digest == digest
    fresh = tmp_path / "fresh"
    built_as(wide, fresh, rendered=28)
    assert read_manifest(fresh).digest == digest


def test_starting_over(built: Built, tmp_path: Path) -> None:
    root = copy_of(built, tmp_path / "d")
    (root / "notes.txt").write_text("mine")
    other = config_for(built[0].heads.source, render={"resolution": 64})
    with pytest.raises(DatasetError, match=r"the dataset there will be deleted; nothing was changed"):
        run(other, root, fresh=True)
    assert verify_dataset(root).ok
    built_as(other, root, rendered=12, fresh=True, confirm=lambda what: True)
    assert (root / "notes.txt").read_text() == "mine"


def test_chunks_stay_together_when_a_plan_grows(tmp_path: Path) -> None:
    earlier = Earlier({}, {})
    seen: set[frozenset] = set()
    for count in (30, 70, 71):
        plan = uniform_plan(count, 3)
        numbers = assign_chunks(plan, 8, earlier)
        chunks = cut(plan, numbers, earlier)
        built = sorted(pose for chunk in chunks for pose in chunk.poses)
        assert built == [*map(tuple, plan.angles_deg.tolist())]
        assert all(1 <= len(chunk.poses) <= 8 for chunk in chunks)
        assert all(chunk.earlier_indices is None for chunk in chunks), "off the grid nothing moves"
        now = {frozenset(map(tuple, chunk.poses)) for chunk in chunks}
        assert seen <= now
        seen = now
        poses = [tuple(pose) for pose in plan.angles_deg.tolist()]
        off_grid = dict.fromkeys(poses, (-1, -1, -1))
        earlier = Earlier(dict(zip(poses, numbers.tolist(), strict=True)), off_grid)


def test_poses_csv_keeps_its_chunks_to_itself(tmp_path: Path) -> None:
    plan = grid_plan()
    chunks = np.arange(len(plan)) // 100
    (tmp_path / "poses.csv").write_text(poses_csv(PosePlans(plan, {}, {None: chunks})))
    assert np.array_equal(read_pose_plans(tmp_path / "poses.csv").chunks[None], chunks)
    again = csv_plan(tmp_path / "poses.csv")
    assert np.array_equal(again.angles_deg, plan.angles_deg)
    assert np.array_equal(again.indices, plan.indices)


def test_parts_of_a_head_that_broke_are_not_deleted(parametric_heads: Path, tmp_path: Path) -> None:
    """Not even when deletion was agreed to: the head may be mended, its renders would be lost."""
    heads, root = tmp_path / "heads", tmp_path / "dataset"
    shutil.copytree(parametric_heads, heads)
    run(config_for(heads), root)
    before = sorted(p.name for p in (root / "data").rglob("*.parquet"))
    mesh = sorted(heads.iterdir())[0] / "neutral.obj"
    whole = mesh.read_bytes()
    mesh.write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(DatasetError, match="was built before but not this time"):
        run(config_for(heads), root, confirm=lambda what: True)
    assert sorted(p.name for p in (root / "data").rglob("*.parquet")) == before
    mesh.write_bytes(whole)
    assert run(config_for(heads), root).complete

# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets that the tests of builds begin with."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from dry_build import DryBuild
from replaying import Lanes
from small_builds import close_lanes, config_for, run

from generator.plan.config import BuildConfig

collect_ignore = [] if find_spec("cv2") else ["test_truth.py"]
"""Which looks at images with a library of the build extra."""


@pytest.fixture(scope="session", autouse=True)
def lanes() -> Iterator[None]:
    """Those that builds of the tests share end with the last test."""
    yield
    close_lanes()


@pytest.fixture
def dry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DryBuild:
    """Two heads and a folder where nothing is built yet; without the map, which takes most of the time."""
    monkeypatch.setattr("generator.execution.build.run.detection_map", lambda root, manifest, file: file)
    return DryBuild(tmp_path, "amy", "bob")


@pytest.fixture
def again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lanes:
    """Lanes without a renderer in which replay renders."""
    lanes = Lanes(tmp_path / "scratch")
    monkeypatch.setattr("generator.execution.replay.open_executor", lanes.open)
    monkeypatch.setattr("generator.execution.replay.scratch_folder", lanes.folder)
    return lanes


@pytest.fixture(scope="session")
def built(parametric_heads: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[BuildConfig, Path]:
    """Two heads x six poses, by the local executor."""
    root = tmp_path_factory.mktemp("built") / "dataset"
    config = config_for(parametric_heads)
    result = run(config, root)
    assert result.complete
    return config, root

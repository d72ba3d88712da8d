# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures over :mod:`small_dataset`."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from known_error import build_known
from small_dataset import HEADS, SMALL_PLAN, build_dataset, unit_rows
from varied_looks import build_varied

from generator.dataset.format.manifest import Manifest
from generator.dataset.format.unit_rows import UnitRows


@pytest.fixture(scope="session")
def build() -> Callable[..., Manifest]:
    return build_dataset


@pytest.fixture
def rows() -> UnitRows:
    """One unit of 18 poses, two of them misses."""
    return unit_rows(HEADS[0], SMALL_PLAN, slice(None))


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset of 2 heads x 18 poses, images as files, two misses a head; nobody changes it."""
    root = tmp_path_factory.mktemp("source") / "dataset"
    build_dataset(root)
    return root


@pytest.fixture
def dataset(tmp_path: Path, source: Path) -> Path:
    """A copy of it, in 4 parts, which the test may damage."""
    return Path(shutil.copytree(source, tmp_path / "dataset"))


@pytest.fixture(scope="session")
def known(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset whose detector is off by a known error; nobody changes it."""
    return build_known(tmp_path_factory.mktemp("known") / "dataset")


@pytest.fixture(scope="session")
def varied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset whose looks are drawn; nobody changes it."""
    return build_varied(tmp_path_factory.mktemp("varied") / "dataset")

# SPDX-License-Identifier: GPL-3.0-or-later
"""One finished dataset that the tests of builds compare with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from small_builds import close_lanes, config_for, run

from generator.plan.config import BuildConfig


@pytest.fixture(scope="session", autouse=True)
def lanes() -> Iterator[None]:
    """Those that builds of the tests share end with the last test."""
    yield
    close_lanes()


@pytest.fixture(scope="session")
def built(parametric_heads: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[BuildConfig, Path]:
    """Two heads x six poses, by the local executor."""
    root = tmp_path_factory.mktemp("built") / "dataset"
    config = config_for(parametric_heads)
    result = run(config, root)
    assert result.complete
    return config, root

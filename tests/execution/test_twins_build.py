# SPDX-License-Identifier: GPL-3.0-or-later
"""Twins with a real renderer: killed and resumed, seen in pixels, rendered again to the same bytes."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from small_builds import host, run

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.execution.replay import replay_samples
from generator.plan.config import BuildConfig

pytestmark = pytest.mark.slow

FACTORS = ("glasses", "lens", "noise")


@pytest.fixture(scope="module")
def twins(built: tuple[BuildConfig, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of all tests with twins: its build was killed in the middle of them, and resumed."""
    root = tmp_path_factory.mktemp("twins") / "dataset"
    config = with_twins(built[0])
    with host(config, root) as started:
        while started.process.poll() is None and not list(root.glob("twins/*/*.parquet")):
            time.sleep(0.05)
        started.process.kill()
        started.wait()
    assert not (root / "manifest.json").exists()
    assert run(config, root).complete
    return root


def with_twins(config: BuildConfig) -> BuildConfig:
    return replace(config, dataset=replace(config.dataset, twins=FACTORS))


def test_killed_and_resumed_is_as_if_never_killed(
    twins: Path, built: tuple[BuildConfig, Path], tmp_path: Path
) -> None:
    report = verify_dataset(twins)
    assert report.ok, report.text()
    found, plain = read_manifest(twins), read_manifest(built[1])
    assert found.digest == plain.digest and [p.sha256 for p in found.parts] == [p.sha256 for p in plain.parts]
    # One lane, and the factors in another order.
    other = replace(built[0], dataset=replace(built[0].dataset, twins=FACTORS[::-1]))
    run(other, tmp_path / "dataset", "serial")
    assert read_manifest(tmp_path / "dataset").twins_digest == found.twins_digest


def test_a_factor_is_seen_where_it_is(twins: Path) -> None:
    """Glasses before the eyes, noise everywhere, and another camera."""
    rows = {row["sample_id"]: row for row in pq.read_table(twins / "data", partitioning=None).to_pylist()}
    made = 0
    for twin in pq.read_table(twins / "twins", partitioning=None).to_pylist():
        row = rows[twin["twin_of"]]
        one, other = (np.asarray(Image.open(twins / r["image_path"])).astype(int) for r in (row, twin))
        changed = np.abs(one - other).max(axis=2) > 0
        if twin["factor"] == "glasses" and not twin["look_left_out"]:
            made += 1
            assert 0.002 < changed.mean() < 0.25, "of the face alone"
            assert not changed[:8].any() and not changed[-8:].any()
        elif twin["factor"] == "noise":
            assert changed.mean() > 0.3
        elif twin["factor"] == "lens":
            assert twin["camera"] != row["camera"] and changed.any()
            assert twin["rotation"] == row["rotation"]
    assert made >= 6


def test_twins_are_rendered_again_to_the_same_bytes(twins: Path) -> None:
    name = pq.read_table(twins / "data", columns=["sample_id"], partitioning=None)["sample_id"][0].as_py()
    names = [name, *(f"{name}~{factor}" for factor in FACTORS)]
    found = [*replay_samples(twins, names, workers=1)]
    assert [one.sample_id for one in found] == names
    for one in found:
        assert one.same, one.text()

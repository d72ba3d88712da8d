# SPDX-License-Identifier: GPL-3.0-or-later
"""Twins are held against the plan and against their rows, column by column."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import small_dataset

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.manifest import Manifest, read_manifest
from generator.dataset.format.open import read_rows
from generator.dataset.proof.choose import choose_twins
from generator.dataset.proof.context import known_config
from generator.dataset.proof.twin_checks import TwinPlan, by_factor, may_differ, must_differ, twin_problems
from generator.dataset.proof.verify import verify_dataset
from generator.plan.pose_plans import PosePlans

FACTORS = ("light", "noise")
ROWS = len(small_dataset.SMALL_PLAN)
NAN = float("nan")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 heads x 18 poses, and a twin of each row with another light and with noise."""
    root = tmp_path_factory.mktemp("twins") / "d"
    small_dataset.build_dataset(root, "none", twins=FACTORS)
    return root


@pytest.fixture(scope="module")
def manifest(root: Path) -> Manifest:
    return read_manifest(root)


@pytest.fixture(scope="module")
def twins(root: Path, manifest: Manifest) -> pa.RecordBatch:
    """Of the first head, with another light."""
    [part] = [one for one in manifest.twins if "s1light" in one.path]
    [batch] = read_rows(root, [part], None)
    return batch


@pytest.fixture
def plan(root: Path, manifest: Manifest) -> TwinPlan:
    poses = DatasetPoses(small_dataset.HEADS, PosePlans(small_dataset.SMALL_PLAN))
    return TwinPlan(known_config(manifest, root), small_dataset.HEADS, poses)


def changed(batch: pa.RecordBatch, column: str, value: Any, row: int = 3) -> pa.RecordBatch:
    """One value of one row."""
    place = batch.schema.get_field_index(column)
    values = batch.column(place).to_pylist()
    values[row] = value
    field = batch.schema.field(place)
    return batch.set_column(place, field, pa.array(values, field.type))


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("width", None, ""),
        ("look_noise", 0.25, "look_noise differs from its row, and is not of light"),
        ("look_backdrop", "sky", "look_backdrop differs from its row, and is not of light"),
        ("width", 65, "width differs from its row, and is not of light"),
        ("camera", [1.0] * 9, "camera differs from its row, and is not of light"),
        ("rotation", [NAN] * 9, "rotation differs from its row, and is not of light"),
        ("landmarks_exact", [0.0] * 1404, "landmarks_exact differs from its row"),
        ("landmarks", [7.0] * 1404, ""),
        ("detected", False, ""),
        (
            "twin_of",
            "s1/neutral/y-30_p-20_r+0",
            "twin_of is s1/neutral/y-30_p-20_r+0, of which it is no twin",
        ),
        ("twin_of", "s1/neutral/y+1_p+0_r+0", "the row of which it is the twin is not there"),
    ],
)
def test_one_twin_that_differs_in_something_else(
    root: Path, manifest: Manifest, twins: pa.RecordBatch, column: str, value: Any, said: str
) -> None:
    batch = twins if value is None else changed(twins, column, value)
    found = list(twin_problems(batch, "light", root, manifest))
    name = twins.column("sample_id")[3].as_py()
    assert all(problem.startswith(f"{name}: ") for problem in found)
    assert any(said in problem for problem in found) if said else not found


def test_a_twin_without_anything_of_its_factor(root: Path, manifest: Manifest, twins: pa.RecordBatch) -> None:
    base = pq.read_table(root / "data", partitioning=None).to_pylist()
    [row] = (one for one in base if one["sample_id"] == twins.column("twin_of")[5].as_py())
    batch = twins
    for column in may_differ("light") & {*row}:
        batch = changed(batch, column, row[column], 5) if column != "sample_id" else batch
    [problem] = twin_problems(batch, "light", root, manifest)
    assert problem == f"{twins.column('sample_id')[5].as_py()}: nothing of light differs from its row"


def test_rows_may_lie_in_parts_of_several_heads(
    root: Path, manifest: Manifest, twins: pa.RecordBatch
) -> None:
    """Of which the manifest says no subject."""
    parts = tuple(replace(part, subject="", expression="") for part in manifest.parts)
    assert list(twin_problems(twins, "light", root, replace(manifest, parts=parts))) == []


def test_what_a_factor_changes() -> None:
    assert must_differ("lens") == {"camera"} < may_differ("lens")
    assert "landmarks_visible" not in may_differ("light") and "landmarks_visible" in may_differ("glasses")
    assert must_differ("light") < may_differ("light")
    assert must_differ("occluder") == {"look_occluder"} and "look_occluder_x" in may_differ("occluder")


def test_each_planned_twin_is_there_once(root: Path, plan: TwinPlan) -> None:
    assert verify_dataset(root, workers=1).ok
    assert plan.factors == FACTORS and plan.planned.shape == (2, 2, ROWS) and plan.planned.all()
    every = np.arange(ROWS)
    for factor in FACTORS:
        for head in range(2):
            plan.add(factor, np.full(ROWS, head), every)
    assert list(plan.problems(0)) == list(plan.problems(3)) == []
    plan.add("noise", np.array([1, 0, 0]), np.array([2, 0, 0]))
    assert list(plan.problems(0)) == [
        "s1/neutral/y-30_p-20_r+0~noise is there more than once",
        "s2/neutral/y-30_p+0_r+0~noise is there more than once",
    ]


def test_a_row_without_a_twin_is_right_where_none_is_planned(
    plan: TwinPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = plan.planned.copy()
    planned[0, 1, 4] = False
    monkeypatch.setattr(TwinPlan, "planned", planned)
    for number in np.argwhere(planned):
        plan.add(FACTORS[number[0]], number[1:2], number[2:])
    assert list(plan.problems(0)) == []
    plan.add("light", np.array([1]), np.array([4]))
    [problem] = plan.problems(0)
    assert problem.startswith("s2/neutral/") and problem.endswith("~light is not in the plan")


def test_a_twin_that_is_missing_and_one_that_nobody_planned(plan: TwinPlan) -> None:
    missing = [*plan.problems(0)]
    assert len(missing) == 4 * ROWS and missing[0] == "s1/neutral/y-30_p-20_r+0~light is missing"
    failed = [*plan.problems(2)]
    assert failed == ["2 units failed, see failures.jsonl", *missing]
    names = {problem.removesuffix(" is missing") for problem in missing}
    config, heads, poses = plan._config, plan._heads, plan._poses
    assert names == set(choose_twins(config, heads, poses))
    nothing = replace(config, dataset=replace(config.dataset, twins=()))
    assert list(choose_twins(nothing, heads, poses)) == []
    assert TwinPlan(nothing, heads, poses).planned.size == 0


def test_rows_by_their_factor(twins: pa.RecordBatch) -> None:
    [(factor, rows)] = by_factor(twins)
    assert factor == "light" and rows.all() and len(rows) == ROWS
    found = dict(by_factor(changed(twins, "factor", "noise")))
    assert np.flatnonzero(found["noise"]).tolist() == [3] and (found["noise"] ^ found["light"]).all()

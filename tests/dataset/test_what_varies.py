# SPDX-License-Identifier: GPL-3.0-or-later
"""What varies in a dataset, as its card and its report tell it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_dataset import HEADS
from varied_looks import DRAWN

from generator.dataset.format.manifest import read_manifest
from generator.dataset.show.card import dataset_card
from generator.dataset.show.drawn_values import DrawnValues
from generator.dataset.show.factors import MOST, NARROW, QUARTERS, Factor, factors_of
from generator.dataset.show.report.page import report_data
from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.view_plan import drawn_render, plan_views

POSES = [(float(yaw), float(pitch), 0.0) for yaw in range(-60, 61, 3) for pitch in range(-30, 31, 3)]


def factors(**render: Any) -> dict[str, Factor]:
    return {one.name: one for one in factors_of(load_config(None, {"render": render}).as_dict())}


@pytest.mark.parametrize("name", ["ambient", "exposure_ev", "noise", "background, red"])
def test_quarters_of_a_distribution_are_as_likely(name: str) -> None:
    one = factors(**DRAWN)[name]
    rng = np.random.default_rng(0)
    drawn = np.array([one.distribution.draw(rng) for _ in range(4000)])
    for bins, count in ((one.parts, QUARTERS), (one.narrow, NARROW)):
        assert len(bins) == count
        place = np.bincount(bins.place(drawn), minlength=count)
        assert place.sum() == 4000
    assert np.abs(np.bincount(one.parts.place(drawn)) / 4000 - 1 / QUARTERS).max() < 0.03
    assert one.parts.place(np.array([np.nan])).tolist() == [-1]


def test_choices_are_told_one_by_one() -> None:
    found = factors(**DRAWN)
    assert found["jpeg"].parts.names == ("50", "80", "90")
    assert found["jpeg"].drawn_from == "choice: 50 ×2, 80, 90"
    assert found["ambient"].drawn_from == "head:uniform:0.2,0.6"
    assert found["jpeg"].parts.place(np.array([79.9999, 50, 90])).tolist() == [1, 0, 2]
    backdrop = found["backdrop"].parts
    assert backdrop.place(np.array(["noise", "", "plain"], object)).tolist() == [1, -1, 0]
    many = factors(environment="choice:" + ",".join(f"e{k}" for k in range(30)))["environment"].parts
    assert len(many) == MOST and many.names[-1] == "19 others"
    assert many.place(np.array(["e0", "e11", "e29"], object)).tolist() == [0, MOST - 1, MOST - 1]


def test_what_a_camera_tells_of_its_draws() -> None:
    """All that has no column of its own."""
    for render in (
        {"distance_mm": "log-uniform:400,8000", "zoom": True, "margin": "uniform:1,2.2", "aspect": 0.7},
        {"lens_mm": "uniform:28,135", "margin": "uniform:1,2.2", "aspect": 1.5},
        {"lens_mm": "uniform:28,135", "distance_mm": "uniform:900,1000", "margin": "uniform:1,2"},
    ):
        given = {**render, "shift_x": "normal:0,0.05", "shift_y": "normal:0,0.05"}
        config = load_config(None, {"render": given})
        views = [*plan_views(config, "s1/neutral", HEADS[0].radius_mm, POSES[:20])]
        batch = pa.table(
            {
                "subject": ["s1"] * 20,
                "expression": ["neutral"] * 20,
                "camera": [view.camera.matrix.ravel() for view in views],
                "translation_mm": [view.camera.translation_mm for view in views],
                "projection": ["perspective"] * 20,
                "width": [view.camera.width for view in views],
                "height": [view.camera.height for view in views],
            },
            schema=pa.schema(
                [("subject", pa.string()), ("expression", pa.string()), ("camera", pa.list_(pa.float64(), 9)),
                 ("translation_mm", pa.list_(pa.float64(), 3)), ("projection", pa.string()),
                 ("width", pa.int32()), ("height", pa.int32())]
            ),
        )  # fmt: skip
        reader = DrawnValues(factors_of(config.as_dict()), HEADS, config.as_dict())
        names = [one.name for one in reader.factors]
        told = (
            {*given}
            - {"zoom", "aspect"}
            - ({"margin"} if "lens_mm" in given and "distance_mm" in given else set())
        )
        assert {*names} == told
        for name, values in zip(names, reader.of(batch), strict=True):
            drawn = [getattr(drawn_render(config, "s1/neutral", pose), name) for pose in POSES[:20]]
            np.testing.assert_allclose(values, drawn, rtol=2e-5, atol=2e-4)


def test_the_report_counts_what_the_table_says(varied: Path) -> None:
    variety = report_data(varied, lambda _: None)["variety"]
    table = pq.read_table(varied / "data").to_pylist()
    by_name = {one["name"]: one for one in variety["factors"]}
    assert {*by_name} == {"ambient", "exposure_ev", "noise", "jpeg", "backdrop", "background, red"}
    assert by_name["ambient"]["whose"] == "head" and by_name["noise"]["whose"] == "image"
    for name, key in (("backdrop", "look_backdrop"), ("jpeg", "look_jpeg")):
        parts = by_name[name]["parts"]
        rows = Counter(str(row[key]).removesuffix(".0") for row in table)
        found = Counter(str(row[key]).removesuffix(".0") for row in table if row["detected"])
        assert parts["rows"] == [rows[value] for value in parts["names"]]
        assert parts["found"] == [found[value] for value in parts["names"]]
    red = np.array([row["look_background"][0] for row in table])
    assert by_name["background, red"]["parts"]["rows"] == np.histogram(red, 4, (0, 1))[0].tolist()
    assert by_name["background, red"]["histogram"]["rows"] == np.histogram(red, NARROW, (0, 1))[0].tolist()
    for factor in variety["factors"]:
        assert sum(factor["histogram"]["rows"]) == sum(factor["parts"]["rows"]) == len(table)
        for examples, rows, found in zip(
            factor["examples"], factor["parts"]["rows"], factor["parts"]["found"], strict=True
        ):
            tiles = [variety["tiles"][name] for name in examples]
            assert len(tiles) == min(2, rows)
            assert any(not tile["detected"] for tile in tiles) == (found < rows), "a missed one, if there is"


def test_the_card_lists_what_varies(varied: Path) -> None:
    card = dataset_card(read_manifest(varied), HEADS)
    assert "## What varies" in card
    assert "| ambient | <code>head:uniform:0.2,0.6</code> |  | head | Share of the light" in card
    assert "| background, red | <code>uniform:0,1</code> |" in card and "background, green" not in card


def test_where_nothing_varies_nothing_is_said(known: Path) -> None:
    assert report_data(known, lambda _: None)["variety"] is None
    assert "What varies" not in dataset_card(read_manifest(known), HEADS)


def test_a_manifest_with_a_distribution_that_is_none_is_one_line() -> None:
    with pytest.raises(UsageError, match=r"^manifest\.json: render\.ambient: the low end 2 is above"):
        factors_of({"render": {"ambient": "uniform:2,1"}, "more": 3})
    assert factors_of({"render": "none"}) == [] == factors_of({})

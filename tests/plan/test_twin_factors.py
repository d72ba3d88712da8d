# SPDX-License-Identifier: GPL-3.0-or-later
"""Factors of twins: made of settings that there are, drawn as they may be, one of a pair always plain."""

from __future__ import annotations

from typing import Any

import pytest

from generator.plan.config import load_config
from generator.plan.factors import FACTORS, is_twin, row_name
from generator.plan.settings import Look, Render, section_settings
from generator.plan.twins import has_twin, is_plain, twin_render
from generator.plan.view_plan import drawn_render

POSES = [(float(yaw), 0.0, float(roll)) for yaw in range(-40, 41, 10) for roll in (-10, 0)]
DRAWN = {
    "none": {},
    "photo": {"variety": "photo"},
    "some of it": {
        "noise": "choice:0,0,0,0.01",
        "jpeg": "choice:100,100,50",
        "glasses": "choice:none,none,round",
    },
}
ALONE = {"wear_variant", "background"}
"""What varies in a look and belongs to no factor: colours."""


def test_settings_of_a_look_that_vary_belong_to_a_factor() -> None:
    """Or a new one is measured by no twin, and nobody notices."""
    varying = {one.key for one in section_settings("render", Render) if one.info.varies}
    every = {key for factor in FACTORS.values() for key in factor.settings}
    assert every <= varying
    of_looks = {one.key for one in section_settings("look", Look) if one.info.varies}
    assert of_looks - every == ALONE
    assert sum(len(factor.settings) for factor in FACTORS.values()) == len(every), "of one alone"


@pytest.mark.parametrize("render", DRAWN.values(), ids=DRAWN)
@pytest.mark.parametrize("name", [name for name in FACTORS if name != "thing"])
def test_one_of_a_pair_is_plain_and_nothing_else_differs(name: str, render: dict[str, Any]) -> None:
    config, factor = load_config(None, {"render": render}), FACTORS[name]
    for pose in POSES:
        row = drawn_render(config, "a/neutral", pose)
        twin = twin_render(config, "a/neutral", 120.0, pose, factor)
        assert is_plain(row, factor) != is_plain(twin, factor)
        differs = {key for key in vars(Render()) if getattr(row, key) != getattr(twin, key)}
        assert differs & {*factor.draws}
        assert differs <= {*factor.settings, *(["zoom"] if factor.camera else [])}
        again = twin_render(config, "a/neutral", 120.0, pose, factor)
        assert again == twin


def test_twins_draw_what_the_configuration_draws() -> None:
    """So that images with a factor are alike, whichever of the two is the row."""
    config = load_config(None, {"render": {"jpeg": "choice:100,100,100,37"}})
    drawn = {twin_render(config, "a/neutral", 120.0, pose, FACTORS["jpeg"]).jpeg for pose in POSES}
    assert drawn == {37.0, 100.0}
    nothing_else = load_config(None, {"render": {"jpeg": "choice:100,100"}})
    found = [twin_render(nothing_else, "a/neutral", 120.0, pose, FACTORS["jpeg"]).jpeg for pose in POSES]
    assert all(10 <= quality <= 60 for quality in found), "the factor's own"


def test_a_share_is_kept() -> None:
    config = load_config(None, {"dataset": {"twins": ["jpeg"], "twins_share": 0.25}})
    chosen = sum(has_twin(config, f"s{k}/neutral", pose, "jpeg") for k in range(200) for pose in POSES)
    assert 0.23 < chosen / (200 * len(POSES)) < 0.27


def test_names_tell_twins() -> None:
    assert row_name("y+0_p+0_r+0") == "y+0_p+0_r+0"
    assert is_twin(f"a~b/neutral/{row_name('y+0_p+0_r+0', 'light')}")
    assert not is_twin("a~b/neut~ral/y+0_p+0_r+0")

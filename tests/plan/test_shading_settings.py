# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, occlusion, gloss and relief as settings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.settings import Look
from generator.plan.shading import Lamp, unshaded
from generator.plan.view_plan import plan_views


def test_a_lamp_is_there_if_it_has_a_strength() -> None:
    assert Look().lamps == ()
    look = Look(
        lamp1_warmth=1.0, lamp3_strength=0.5, lamp3_yaw_deg=20.0, lamp3_pitch_deg=-5.0, lamp3_warmth=2.0
    )
    assert look.lamps == (Lamp(20.0, -5.0, 0.5, 2.0),)
    assert len(replace(look, lamp1_strength=0.1, lamp2_strength=0.2).lamps) == 3


def test_unshaded_is_all_else() -> None:
    plain = Look(ambient=0.2, glasses="round")
    assert unshaded(replace(plain, gloss=0.5, occlusion=1.0, lamp2_strength=1.0, skin_detail=0.3)) == plain


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gloss", 1.5),
        ("occlusion", -0.1),
        ("skin_detail", "uniform:0,5"),
        ("lamp1_strength", "choice:0,-1"),
        ("lamp2_yaw_deg", 190),
        ("lamp3_warmth", "normal:0,-1"),
    ],
)
def test_what_cannot_be_is_refused_by_name(key: str, value: Any) -> None:
    with pytest.raises(UsageError, match=rf"render\.{key}"):
        load_config(None, {"render": {key: value}})


def test_photo_draws_some_lamps_and_a_skin_for_each_person() -> None:
    config = load_config(None, {"render": {"variety": "photo", "environment": "none", "backdrop": "plain"}})
    poses = [(float(yaw), 0.0, 0.0) for yaw in range(-40, 40, 2)]
    ann, bob = (plan_views(config, f"{name}/neutral", 120.0, poses) for name in ("ann", "bob"))
    assert {len(view.look.lamps) for view in ann} == {0, 1, 2}
    skins = [{(view.look.gloss, view.look.skin_detail) for view in views} for views in (ann, bob)]
    assert [len(skin) for skin in skins] == [1, 1] and skins[0] != skins[1]

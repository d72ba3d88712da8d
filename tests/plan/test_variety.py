# SPDX-License-Identifier: GPL-3.0-or-later
"""--variety: distributions of what is not given."""

from __future__ import annotations

from pathlib import Path

import pytest

from generator.errors import UsageError
from generator.plan.config import config_toml, load_config, read_recorded
from generator.plan.settings import Render, section_settings
from generator.plan.variety import CHOICES, VARIETY
from generator.plan.view_plan import plan_views
from generator.plan.wear import STYLES

POSES = [(float(yaw), 0.0, 0.0) for yaw in range(-30, 31, 5)]


def test_each_choice_has_its_distributions_and_they_are_legal() -> None:
    assert {choice.value for choice in CHOICES} == set(VARIETY)
    known = {one.key: one for one in section_settings("render", Render)}
    for name, values in VARIETY.items():
        config = load_config(None, {"render": {"variety": name}})
        assert {key for key, value in values.items() if isinstance(value, (str, list))} == {
            drawn.split(".")[1] for drawn in config.drawn
        }
        assert all(known[key].info.varies or key == "zoom" for key in values)


def test_what_is_given_stays() -> None:
    config = load_config(None, {"render": {"variety": "photo", "ambient": 0.5, "jpeg": "uniform:90,95"}})
    assert config.render.ambient == 0.5 and "render.ambient" not in config.drawn
    assert config.drawn["render.jpeg"].text == "uniform:90,95"


def test_nothing_varies_by_default() -> None:
    config = load_config(None, {})
    assert not config.drawn
    views = plan_views(config, "amy/neutral", 120.0, POSES)
    assert (len(views.cameras), views.looks, views.seeds) == (1, (config.render.look,), (0,))
    assert config.render.look.is_plain


def test_it_is_recorded_with_all_that_it_stands_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = load_config(None, {"render": {"variety": "photo"}})
    (tmp_path / "config.toml").write_text(config_toml(config.moved_to(tmp_path)))
    monkeypatch.setitem(VARIETY, "photo", {"ambient": "uniform:0,0.1"})
    assert read_recorded(tmp_path / "config.toml").drawn == config.drawn, "whatever it means later"


def test_heads_fit_into_photographs_at_every_distance() -> None:
    config = load_config(None, {"render": {"variety": "photo"}})
    views = plan_views(config, "amy/neutral", 175.0, POSES)
    assert len({view.camera.distance_mm for view in views}) == len(POSES) == len({v.seed for v in views})
    assert all(view.camera.view_mm > 2 * 150 for view in views)


def test_another_variety_is_no_choice() -> None:
    with pytest.raises(UsageError, match=r"render\.variety: Input should be 'none', 'photo' or 'all'"):
        load_config(None, {"render": {"variety": "much"}})


def test_photo_wears_in_the_shares_that_it_says() -> None:
    shares = {"glasses": 0.25, "mask": 0.06, "clothes": 0.9, "hair": 0.75, "occluder": 0.06}
    for kind, share in shares.items():
        texts = str(VARIETY["photo"][kind]).partition("choice:")[2].split(",")
        worn = [text for text in texts if text != STYLES[kind][0]]
        assert {*worn} == {*STYLES[kind][1:]} and len(worn) / len(texts) == pytest.approx(share, abs=0.08)
    assert str(VARIETY["photo"]["hair"]).startswith("head:") and "head:" not in str(
        VARIETY["photo"]["glasses"]
    )

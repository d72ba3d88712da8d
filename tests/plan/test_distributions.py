# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are distributions: how they are written, what is drawn, and what a draw depends on."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generator import registries
from generator.cli.options import values_of
from generator.errors import UsageError
from generator.geometry.camera import framing_distance, framing_lens
from generator.plan.config import BuildConfig, config_toml, load_config, read_recorded
from generator.plan.distribution import (
    Distribution,
    is_choice,
    is_distribution,
    parse_choice,
    parse_distribution,
)
from generator.plan.settings import all_settings
from generator.plan.view_plan import drawn_render, drawn_values, plan_views
from generator.plan.views import View
from generator.registry import Registry

POSES = [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, -20.0, 5.0)]
FLAGS: dict[str, list[Any]] = {}
for one in all_settings():
    if one.flag:
        FLAGS.setdefault(one.flag, []).append(one)


def config(**render: Any) -> BuildConfig:
    return load_config(None, {"render": render})


def drawn(config: BuildConfig, head: str = "amy/neutral", pose: Any = POSES[0]) -> dict[str, float]:
    found = drawn_render(config, head, pose)
    return {name: getattr(found, name.partition(".")[2]) for name in config.drawn}


@pytest.mark.parametrize(
    ("text", "mean", "least", "most"),
    [
        ("uniform:2,6", 4.0, 2, 6),
        ("log-uniform:1,100", 99 / math.log(100), 1, 100),
        ("normal:5,1", 5.0, 0, 10),
        ("choice:1,2,9", 4.0, 1, 9),
        ("choice:0,1000", 500.0, 0, 1000),
    ],
)
def test_draws_have_the_distribution_that_was_asked_for(
    text: str, mean: float, least: float, most: float
) -> None:
    found = parse_distribution(text, 0, 1000)
    rng = np.random.default_rng(0)
    values = np.array([found.draw(rng) for _ in range(4000)])
    assert least <= values.min() and values.max() <= most
    assert abs(values.mean() - mean) < 4 * values.std() / math.sqrt(len(values))
    if text.startswith("log"):
        assert abs(np.log(values).mean() - math.log(10)) < 0.1
    if text.startswith("choice"):
        assert set(values) == set(found.numbers)
    assert found.text == text and parse_distribution(f"head:{text}").per_head


def test_a_normal_distribution_stays_within_what_the_setting_may_be() -> None:
    found = parse_distribution("normal:0.9,0.5", 0, 1)
    rng = np.random.default_rng(1)
    values = [found.draw(rng) for _ in range(500)]
    assert min(values) >= 0 and max(values) <= 1 and len(set(values)) > 400


def test_what_is_drawn_has_six_significant_digits() -> None:
    found, rng = parse_distribution("uniform:0,1"), np.random.default_rng(0)
    values = [found.draw(rng) for _ in range(50)]
    assert all(float(f"{value:.6g}") == value for value in values)
    assert any(float(f"{value:.5g}") != value for value in values)


def test_what_can_hardly_be_drawn_is_the_middle() -> None:
    assert Distribution("normal", (5.0, 0.1), low=50).draw(np.random.default_rng(0)) == 5.0


@pytest.mark.parametrize(
    ("text", "middle"),
    [
        ("uniform:5,5", 5),
        ("uniform:0,0", 0),
        ("log-uniform:4,4", 4),
        ("log-uniform:4,9", 6),
        ("normal:5,0", 5),
        ("normal:5,2000", 5),  # a deviation is no value
        ("choice:0", 0),
        ("uniform:0,1000", 500),
    ],
)
def test_what_just_is_a_distribution(text: str, middle: float) -> None:
    found = parse_distribution(text, 0, 1000)
    assert found.middle == middle and 0 <= found.draw(np.random.default_rng(0)) <= 1000


@pytest.mark.parametrize(
    ("limits", "span"), [({"low": 2}, "from 2 to any"), ({"high": 0.5}, "from any to 0.5")]
)
def test_a_limit_on_one_side(limits: dict[str, float], span: str) -> None:
    with pytest.raises(ValueError, match=f"1 is outside what the setting may be, {span}"):
        parse_distribution("choice:1,2" if "low" in limits else "choice:0.5,1", **limits)


def test_a_choice_of_texts() -> None:
    found = parse_choice("head:choice:cap,hat,none")
    assert (found.text, found.middle, found.per_head) == ("head:choice:cap,hat,none", "cap", True)
    drawn = [found.draw(np.random.default_rng(k)) for k in range(60)]
    assert all(drawn.count(text) > 10 for text in ("cap", "hat", "none"))
    with pytest.raises(ValueError, match="expected texts separated by commas"):
        parse_choice("choice:cap,,none")


@given(st.sampled_from(["uniform", "log-uniform"]), st.floats(0.01, 50), st.floats(0, 50))
def test_the_middle_and_every_draw_are_inside(kind: str, low: float, more: float) -> None:
    found = Distribution(kind, (low, low + more))
    values = [found.middle, *(found.draw(np.random.default_rng(k)) for k in range(3))]
    assert all(low * (1 - 1e-5) <= value <= (low + more) * (1 + 1e-5) for value in values)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("uniform:200,100", "the low end 200 is above the high end 100"),
        ("normal:50,-1", "the standard deviation -1 is below 0"),
        ("log-uniform:0,5", "the low end 0 has no logarithm; give more than 0"),
        ("gauss:1,2", "no distribution 'gauss'; there are uniform, log-uniform, normal, choice"),
        ("uniform:1", "expected two numbers behind uniform:"),
        ("uniform:a,b", "expected numbers separated by commas behind uniform:"),
        ("choice:", "expected numbers separated by commas behind choice:"),
        ("choice:50,nan", "expected numbers that are finite"),
        ("uniform:1,85", "1 is outside what the setting may be, from 10 to 1000"),
        ("normal:5,1", "5 is outside what the setting may be, from 10 to 1000"),
    ],
)
def test_what_is_no_distribution_is_said_in_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError) as error:
        config(lens_mm=text)
    assert str(error.value) == f"configuration: render.lens_mm: {said}"


def test_a_setting_that_does_not_vary_takes_none() -> None:
    with pytest.raises(UsageError, match=r"render\.resolution: .*uniform:64,128"):
        config(resolution="uniform:64,128")


def test_it_stands_in_the_configuration_as_it_was_written(tmp_path: Path) -> None:
    ours = config(lens_mm="uniform:28,135", ambient="head:normal:0.3,0.1")
    assert ours.render.lens_mm == 81.5, "the middle, where one value is needed"
    assert ours.as_dict()["render"]["lens_mm"] == "uniform:28,135"
    (tmp_path / "config.toml").write_text(config_toml(ours.moved_to(tmp_path)))
    assert read_recorded(tmp_path / "config.toml").drawn == ours.drawn


def test_a_draw_depends_on_seed_head_pose_and_its_own_name_alone() -> None:
    one = config(lens_mm="uniform:28,135")
    both = config(lens_mm="uniform:28,135", light_yaw_deg="uniform:-60,60", ambient="uniform:0,1")
    name = "render.lens_mm"
    assert drawn(one)[name] == drawn(both)[name]
    assert drawn(one)[name] != drawn(one, pose=POSES[1])[name] != drawn(one, "bob/neutral")[name]
    reseeded = replace(one, poses=replace(one.poses, seed=1))
    assert drawn(reseeded)[name] != drawn(one)[name]
    together = plan_views(both, "amy/neutral", 120.0, POSES)
    alone = [plan_views(both, "amy/neutral", 120.0, [pose])[0] for pose in POSES]
    assert [*together] == alone, "whichever other images there are"
    assert len({view.camera.lens_mm for view in together}) == 3


def test_what_was_drawn_is_told_as_json_has_it() -> None:
    ours = config(lens_mm="uniform:28,135", background=["uniform:0,1", 0.25, "uniform:0,1"])
    [view] = plan_views(ours, "amy/neutral", 120.0, POSES[:1])
    assert drawn_values(ours, "amy/neutral", POSES[0]) == {
        "lens_mm": view.camera.lens_mm,
        "background": list(view.look.background),
    }
    assert view.seed == 0, "nothing in it is random"


def test_what_others_draw_depends_on_seed_head_pose_and_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    def shaken(view: View, rng: np.random.Generator) -> View:
        return replace(view, look=replace(view.look, ambient=rng.random()))

    def ambients(head: str, seed: int = 0) -> list[float]:
        ours = load_config(None, {"poses": {"seed": seed}})
        return [view.look.ambient for view in plan_views(ours, head, 120.0, POSES)]

    plain = ambients("amy/neutral")
    draws: Registry[Any] = Registry("draw", {})
    monkeypatch.setattr(registries, "DRAWS", draws)
    found = {}
    for name in ("dusk", "dawn"):
        draws.add(name, shaken)
        found |= {
            (name, head, seed): ambients(head, seed) for head in ("amy/neutral", "bob") for seed in (0, 1)
        }
        assert ambients("bob") == found[name, "bob", 0]
        draws.remove(name)
    assert len({value for values in found.values() for value in values}) == 8 * len(POSES)
    assert plain == [plain[0]] * len(POSES) and plain[0] not in {
        v for values in found.values() for v in values
    }


def test_a_draw_a_head_is_the_same_for_all_its_images() -> None:
    ours = config(light_yaw_deg="head:uniform:-60,60")
    looks = {view.look for view in plan_views(ours, "amy/neutral", 120.0, POSES)}
    [other] = {view.look for view in plan_views(ours, "bob/neutral", 120.0, POSES)}
    assert len(looks) == 1 and other not in looks
    assert looks == {view.look for view in plan_views(ours, "amy/smile", 120.0, POSES)}, "of the person"


def test_each_number_of_a_colour_may_be_drawn() -> None:
    ours = config(background=["uniform:0,1", 0.25, "head:choice:0.1,0.9"])
    assert ours.render.background == (0.5, 0.25, 0.1), "the middle"
    assert ours.as_dict()["render"]["background"] == ["uniform:0,1", 0.25, "head:choice:0.1,0.9"]
    red, green, blue = zip(
        *(v.look.background for v in plan_views(ours, "amy/neutral", 120.0, POSES)), strict=True
    )
    assert len(set(red)) == len(POSES) and set(green) == {0.25} and len(set(blue)) == 1
    alone = config(background=["uniform:0,1", "uniform:0,1", 0.5])
    views = plan_views(alone, "amy/neutral", 120.0, POSES)
    assert tuple(view.look.background[0] for view in views) == red, "whatever else is drawn"
    assert all(view.look.background[0] != view.look.background[1] for view in views)


@pytest.mark.parametrize(
    ("background", "said"),
    [
        (["uniform:0,2", 0, 0], "render.background: 2 is outside what the setting may be, from 0 to 1"),
        (["uniform:0,1", 0], "render.background.2: Field required"),
        ("uniform:0,1", "render.background: Input should be a valid tuple, got 'uniform:0,1'"),
    ],
)
def test_what_is_no_colour_is_said_in_one_line(background: Any, said: str) -> None:
    with pytest.raises(UsageError) as error:
        config(background=background)
    assert str(error.value) == f"configuration: {said}"


def test_with_zoom_a_head_fits_at_any_distance() -> None:
    ours = config(distance_mm="log-uniform:400,8000", zoom=True)
    for view in plan_views(ours, "amy/neutral", 120.0, POSES):
        camera = view.camera
        edge = 120.0 / math.sqrt(camera.distance_mm**2 - 120.0**2) * camera.focal_px
        assert abs(edge * 1.05 - camera.width / 2) < 0.07 * camera.width / 2
        assert 400 <= camera.distance_mm <= 8000
    with pytest.raises(UsageError, match=r"stands inside a head of 126 mm; give a larger --distance"):
        plan_views(config(distance_mm=120, zoom=True), "amy/neutral", 120.0, POSES)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_lens_that_fits_is_the_inverse_of_the_distance_that_does(projection: Any) -> None:
    for distance in (400.0, 1234.5, 9000.0):
        lens = framing_lens(120.0, distance, 1.3, projection)
        assert framing_distance(120.0, lens, 1.3, projection) == pytest.approx(distance, rel=1e-12)


@pytest.mark.parametrize("aspect", [1.5, 0.6])
def test_images_need_not_be_square_and_the_head_fits_into_the_shorter_side(aspect: float) -> None:
    [view] = plan_views(config(aspect=aspect, resolution=300), "amy/neutral", 120.0, POSES[:1])
    camera = view.camera
    assert max(camera.width, camera.height) == 300 and abs(camera.width / camera.height - aspect) < 0.01
    radius_px = 120.0 / math.sqrt(camera.distance_mm**2 - 120.0**2) * camera.focal_px
    assert 0.9 < 2 * radius_px / min(camera.width, camera.height) < 1


def test_the_head_stands_where_it_is_shifted_to() -> None:
    [view] = plan_views(config(shift_x=0.1, shift_y=-0.2), "amy/neutral", 120.0, POSES[:1])
    np.testing.assert_allclose(view.camera.project(view.camera.translation_mm), [0.6 * 256, 0.3 * 256])


@pytest.mark.parametrize(
    ("given_", "expected"),
    [
        ({"--lens": "50"}, {"lens_mm": 50.0}),
        ({"--lens": "uniform:28,135"}, {"lens_mm": "uniform:28,135"}),
        ({"--light": "10,20"}, {"light_yaw_deg": 10.0, "light_pitch_deg": 20.0}),
        ({"--background": "0.1,0.2,0.3"}, {"background": [0.1, 0.2, 0.3]}),
        (
            {"--background": "uniform:0,1;0.5;choice:0,1"},
            {"background": ["uniform:0,1", 0.5, "choice:0,1"]},
        ),
        (
            {"--light": "uniform:-60,60;20"},
            {"light_yaw_deg": "uniform:-60,60", "light_pitch_deg": 20.0},
        ),
    ],
)
def test_options_take_numbers_and_distributions(given_: dict[str, str], expected: dict[str, Any]) -> None:
    assert values_of(given_, FLAGS) == {"render": expected}


@pytest.mark.parametrize(
    ("flag", "text", "said"),
    [
        ("--lens", "wide", "expected numbers separated by commas"),
        ("--lens", "50,85", "expected a number, or a distribution such as uniform:1,2"),
        ("--light", "uniform:-60,60", "expected 2 parts with ; between: light_yaw_deg and light_pitch_deg"),
        ("--background", "uniform:0,1", "expected 3 parts with ; between: background"),
    ],
)
def test_options_that_are_neither_are_said(flag: str, text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        values_of({flag: text}, FLAGS)


def test_which_texts_are_distributions() -> None:
    assert is_choice("choice:cap") and is_choice("head:choice:cap") and not is_choice("uniform:1,2")
    assert not is_choice(1.0)
    assert is_distribution("uniform:1,2") and not is_distribution("50") and not is_distribution(50.0)

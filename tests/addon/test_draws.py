# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel has drawn: distributions in a line of text, the variety, and a throw of the dice."""

from __future__ import annotations

from typing import Any

import pytest
from test_addon_fields import Properties

from blender_addon.core import panel
from blender_addon.core.draws import draws_something, with_draws, without_draws
from blender_addon.core.looks import Look
from blender_addon.core.panel import Line
from blender_addon.core.tables import configuration
from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.settings import Values
from generator.plan.variety import VARIETY
from generator.plan.view_plan import drawn_values

TOLD: Values = {
    "render": {
        "lens_mm": "head:uniform:28,135",
        "background": ["uniform:0,1", 0.25, 0.5],
        "backdrop": "choice:plain,noise",
        "ambient": 0.5,
    },
    "poses": {"seed": 3},
}
LINE = "lens_mm=head:uniform:28,135 background=uniform:0,1;0.25;0.5"


def test_distributions_of_numbers_are_a_line_of_text() -> None:
    config, line = without_draws(TOLD)
    assert line == LINE
    assert config == {"render": {"backdrop": "choice:plain,noise", "ambient": 0.5}, "poses": {"seed": 3}}
    assert with_draws(config, line) == TOLD
    assert without_draws(config) == (config, "") and with_draws(config, " ") == config
    said = with_draws({"render": {"lens_mm": 85}}, "lens_mm=uniform:28,135 noise='log-uniform:0.01,0.1'")
    assert said["render"] == {"lens_mm": "uniform:28,135", "noise": "log-uniform:0.01,0.1"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("lens_mm", "render.lens_mm: Input should be a valid number"),
        ("lens=uniform:1,2", "render.lens: no such setting; there is lens"),
        ("ambient='uniform:0,1", "render.ambient"),
        ("ambient=uniform:1,0", "the low end 1 is above the high end 0"),
        ("background=red;0;0", "render.background.0: Input should be a valid number"),
    ],
)
def test_what_is_wrong_with_the_line_is_for_the_host_to_say(line: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        load_config(None, with_draws({}, line))


def test_a_variety_draws_what_nobody_has_touched() -> None:
    """Otherwise every setting of the panel would be one that is given, and nothing would vary."""
    properties = Properties()
    properties["render_variety"] = "photo"
    expected = load_config(None, {"render": {"variety": "photo"}})
    assert load_config(None, configuration(properties.getter, {})).drawn == expected.drawn
    assert load_config(None, configuration(properties.getter, {})).render.zoom
    properties["render_ambient"] = 0.5
    config = configuration(properties.getter, {"render": {"jpeg": 100.0}})
    assert config["render"]["ambient"] == 0.5 and config["render"]["jpeg"] == 100.0, "as the file says it"
    fixed = {"render.ambient", "render.jpeg"}
    assert {*load_config(None, config).drawn} == {*expected.drawn} - fixed
    properties["render_variety"] = "none"
    assert not load_config(None, configuration(properties.getter, {})).drawn


def test_whether_anything_is_drawn() -> None:
    assert draws_something(TOLD) and draws_something({"render": {"variety": "all"}})
    assert draws_something({"render": {"environment": "choice:city,forest"}})
    assert not draws_something({"render": {"variety": "none", "ambient": 0.5}}) and not draws_something({})


def test_every_draw_of_a_look_is_listed() -> None:
    config = load_config(None, {"render": {"variety": "photo"}})
    drawn = drawn_values(config, "amy/neutral", (10.0, 0.0, 0.0))
    look = Look(("amy", "neutral"), (10.0, 0.0, 0.0), 7, drawn)
    told = dict(look.values())
    assert len(told) == len(drawn) == len([one for one in VARIETY["photo"].values() if one is not True])
    assert told["Distance"] == f"{drawn['distance_mm']:.6g} mm" and told["Light Yaw"].endswith("°")
    assert told["Background"] == " ".join(f"{one:.2f}" for one in drawn["background"])


@pytest.mark.parametrize(
    ("pose", "line"),
    [
        ((10.0, 0.0, 0.0), Line("seed 7", "CHECKMARK")),
        ((0.0, 0.0, 0.0), Line("seed 7, amy at 10, 0, 0: show it again for this pose", "INFO")),
    ],
)
def test_a_look_of_another_pose_is_not_taken_for_that_in_view(pose: Any, line: Line) -> None:
    assert panel.look(Look(("amy", "neutral"), (10.0, 0.0, 0.0), 7, {}), pose) == line

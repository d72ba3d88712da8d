# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of the command line follow from the table of settings, and say what was typed."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, get_args

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from legal_settings import inner, value_of
from typer.testing import CliRunner

from generator.cli.options import numbers, pose_source, values_of, with_settings
from generator.cli.preview import DEFAULTS, previewed
from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.setting import Setting, setting
from generator.plan.settings import Values, all_settings

FLAGS: dict[str, list[Setting]] = defaultdict(list)
for one in all_settings():
    if one.flag:
        FLAGS[one.flag].append(one)

TYPED = st.text(st.characters(codec="utf-8", exclude_characters="\0,"), min_size=1, max_size=8)
"""What can be typed, and is not taken for several."""


def command_of(settings: list[Setting], defaults: dict | None = None) -> tuple[typer.Typer, list[Values]]:
    """A command with the options of settings, and what it was called with."""
    calls: list[Values] = []

    def command(*, overrides: Values) -> None:
        """Nothing."""
        calls.append(overrides)

    app = typer.Typer()
    app.command()(with_settings(command, settings, defaults))
    return app, calls


def run(arguments: list[str], settings: list[Setting] | None = None) -> Values:
    """What options say."""
    app, calls = command_of(settings or list(all_settings()))
    done = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return calls[0]


def typed(known: Setting, value: Any) -> list[str]:
    """The options that say a value of one setting."""
    flag = known.flag
    if isinstance(value, bool):
        return [flag if value else f"--not-{flag.removeprefix('--')}"]
    if isinstance(value, tuple) and str in get_args(inner(known.kind)) and not known.choices:
        return [f"{flag}={one}" for one in value]
    if isinstance(value, tuple):
        return [f"{flag}={','.join(map(str, value))}"]
    return [f"{flag}={value}"]


@st.composite
def some_options(draw: st.DrawFn) -> tuple[list[str], Values]:
    """A command line, and what it says by the table."""
    arguments: list[str] = []
    said: Values = defaultdict(dict)
    for flag, group in FLAGS.items():
        if draw(st.booleans()):
            continue
        if flag == "--poses":
            kind, count = (
                draw(st.sampled_from(["grid", "uniform", "sobol", "csv"])),
                draw(st.integers(1, 10**6)),
            )
            told: dict[str, Any] = {"kind": kind}
            if kind == "csv":
                told["path"] = draw(TYPED.map(lambda name: f"{name}.csv"))
            elif kind != "grid":
                told["count"] = count
            text = {"grid": "grid", "csv": told.get("path")}.get(kind, f"{kind}:{count}")
            arguments.append(f"--poses={text}")
            said["poses"] |= told
        elif len({known.section for known in group}) > 1:
            value = draw(value_of(group[0], TYPED))
            arguments += typed(group[0], value)
            for known in group:
                said[known.section][known.key] = value
        elif flag == "--detector":
            first, *further = draw(st.lists(value_of(group[0], TYPED), min_size=1, max_size=3))
            arguments.append(f"{flag}={','.join([first, *further])}")
            said["landmarks"] |= {"detector": first, **({"also": tuple(further)} if further else {})}
        elif len(group) > 1:
            values = [draw(value_of(known, TYPED)) for known in group]
            arguments.append(f"{flag}={','.join(map(str, values))}")
            said[group[0].section] |= {k.key: v for k, v in zip(group, values, strict=True)}
        else:
            value = draw(value_of(group[0], TYPED))
            if value != ():  # which is said by saying nothing
                arguments += typed(group[0], value)
                said[group[0].section][group[0].key] = value
    return draw(st.permutations(arguments)) if not _repeated(arguments) else arguments, dict(said)


def _repeated(arguments: list[str]) -> bool:
    names = [argument.partition("=")[0] for argument in arguments]
    return len(set(names)) < len(names)


@given(some_options())
def test_what_is_typed_is_what_is_set(options: tuple[list[str], Values]) -> None:
    arguments, said = options
    assert load_config(None, run(arguments)) == load_config(None, said)


def test_where_nothing_is_typed_nothing_is_set() -> None:
    assert run([]) == {}
    assert run(["--resolution=64"]) == {"render": {"resolution": 64}}


def test_every_setting_has_an_option_and_no_two_share_one_by_accident() -> None:
    assert {known.name for group in FLAGS.values() for known in group} == {
        s.name for s in all_settings() if s.flag
    }
    shared = {flag: [known.name for known in group] for flag, group in FLAGS.items() if len(group) > 1}
    assert shared == {
        "--seed": ["heads.seed", "poses.seed"],
        "--poses": ["poses.kind", "poses.count", "poses.path"],
        "--light": ["render.light_yaw_deg", "render.light_pitch_deg"],
        "--detector": ["landmarks.detector", "landmarks.also"],
        **{f"--lamp{k}": [f"render.lamp{k}_yaw_deg", f"render.lamp{k}_pitch_deg"] for k in (1, 2, 3)},
    }
    names = [flag.removeprefix("--") for flag in FLAGS]
    assert len(set(names)) == len(names) and all(name.replace("-", "").isalnum() for name in names)


@pytest.mark.parametrize("flag", FLAGS)
def test_the_help_of_an_option_is_that_of_its_setting(flag: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    app, _ = command_of(list(all_settings()))
    help_text = " ".join(CliRunner().invoke(app, ["--help"]).output.split())
    first = FLAGS[flag][0]
    assert flag in help_text
    assert first.info.help in help_text
    if first.info.unit and len(FLAGS[flag]) == 1:
        assert f"{first.info.help} ({first.info.unit})" in help_text
    if 0 < len(first.choices) <= 6 and flag != "--poses":
        assert "|".join(choice.value for choice in first.choices) in help_text


BAD = {
    "--yaw=a,b,c": "--yaw 'a,b,c': expected numbers separated by commas",
    "--yaw=": "--yaw '': expected numbers",
    "--light=1": "--light '1': expected 2 numbers, such as 25,35",
    "--light=1,2,3": "--light '1,2,3': expected 2 numbers",
    "--poses=sobol": "--poses 'sobol': say how many, such as sobol:500",
    "--poses=uniform:many": "--poses 'uniform:many': say how many",
    "--poses=sobol:²": "--poses 'sobol:²': say how many",
    "--poses=uniform:-5": "--poses 'uniform:-5': say how many",
    "--background=0.5,grey,0.5": "--background '0.5,grey,0.5': expected numbers",
}


@pytest.mark.parametrize(("option", "says"), BAD.items(), ids=BAD)
def test_what_cannot_be_read_names_the_option(option: str, says: str) -> None:
    app, _ = command_of(list(all_settings()))
    with pytest.raises(UsageError) as error:
        CliRunner().invoke(app, [option], catch_exceptions=False)
    assert says in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("option", ["--resolution=big", "--resolution=1.5", "--no-such-option=1"])
def test_what_typer_refuses_is_wrong_use(option: str) -> None:
    app, calls = command_of(list(all_settings()))
    assert CliRunner().invoke(app, [option]).exit_code == 2 and not calls


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("grid", {"kind": "grid"}),
        ("sobol:7", {"kind": "sobol", "count": 7}),
        ("uniform:700", {"kind": "uniform", "count": 700}),
        ("mine.csv", {"kind": "csv", "path": "mine.csv"}),
        ("grid:7", {"kind": "csv", "path": "grid:7"}),
        ("C:/poses.csv", {"kind": "csv", "path": "C:/poses.csv"}),
    ],
)
def test_poses_are_named_by_kind_and_count_or_by_their_file(text: str, told: dict) -> None:
    assert pose_source(text) == told


def test_numbers() -> None:
    assert numbers("--x", "1,-2.5, 3e1 ") == [1.0, -2.5, 30.0]


def test_a_command_may_have_other_defaults_and_fewer_settings() -> None:
    app, calls = command_of(previewed(), DEFAULTS)
    assert CliRunner().invoke(app, []).exit_code == 0
    assert calls == [{"render": {"preset": "quality", "resolution": 512}}]
    assert CliRunner().invoke(app, ["--preset=fast"]).exit_code == 0
    assert calls[1] == {"render": {"preset": "fast", "resolution": 512}}
    assert CliRunner().invoke(app, ["--yaw=1,2,3"]).exit_code == 2, "a preview has no grid"


def test_options_of_the_command_itself_stay() -> None:
    seen: list[Any] = []

    def command(name: str, often: int = 1, *, overrides: Values) -> None:
        """What it does."""
        seen.append((name, often, overrides))

    app = typer.Typer()
    app.command()(with_settings(command, all_settings()))
    assert CliRunner().invoke(app, ["amy", "--often", "3", "--lens=50"]).exit_code == 0
    assert seen == [("amy", 3, {"render": {"lens_mm": 50.0}})]
    assert "What it does." in CliRunner().invoke(app, ["--help"]).output


@pytest.mark.parametrize(
    ("kind", "default", "arguments", "value"),
    [
        (int, 1, ["--later", "7"], 7),
        (float | None, None, ["--later", "7"], 7.0),
        (bool, False, ["--later"], True),
        (bool | None, None, ["--not-later"], False),
        (tuple[str, ...], (), ["--later", "a", "--later", "b"], ["a", "b"]),
        (tuple[float, ...], (), ["--later", "1,2"], [1.0, 2.0]),
    ],
    ids=str,
)
def test_a_setting_that_is_added_has_an_option(kind: Any, default: Any, arguments: list, value: Any) -> None:
    known = Setting("render", "later", kind, default, setting(default, "Later").metadata["info"])  # type: ignore[attr-defined]
    assert run(arguments, [known]) == {"render": {"later": value}}
    assert values_of({"--later": None}, {"--later": [known]}) == {}

# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings as properties and back: what follows from the table, without Blender."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tomllib

from blender_addon.core import config
from blender_addon.core.field import Get
from blender_addon.core.fields import field_of, fields
from blender_addon.core.tables import check_shown, configuration, located, properties_of, section_of
from blender_addon.core.texts import FOLDER, MESHES, asks_for_folder
from blender_addon.core.words import HELP, LIMITS, UNSET, titled
from generator.errors import UsageError
from generator.heads.folders import SUFFIXES
from generator.plan.config import BuildConfig, config_toml, load_config
from generator.plan.poses import ANGLES, grid_plan
from generator.plan.setting import Choice, Info, Setting, setting
from generator.plan.settings import SECTIONS, Render, Values, all_settings, section_settings


class Properties(dict[str, Any]):
    """What Blender's properties would hold: numbers of 32 bits, within their limits."""

    def __init__(self, told: Values | None = None) -> None:
        super().__init__()
        self.options = {name: p.options for f in fields() for name, p in f.properties().items()}
        for name, options in self.options.items():
            self[name] = options.get("default", "")
        for name, value in properties_of(told or {}).items():
            self[name] = value

    def __setitem__(self, name: str, value: Any) -> None:
        super().__setitem__(name, self._held(value, self.options[name]))

    def _held(self, value: Any, options: dict[str, Any]) -> Any:
        if isinstance(value, tuple):
            return [self._held(float(one), options) for one in value]
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            value = min(max(value, options.get("min", value)), options.get("max", value))
        return struct.unpack("f", struct.pack("f", value))[0] if isinstance(value, float) else value

    @property
    def getter(self) -> Get:
        return self.__getitem__


def round_trip(told: Values) -> Values:
    properties = Properties(told)
    check_shown(properties.getter, told)
    return configuration(properties.getter, told)


def test_every_setting_with_a_label_has_properties_named_after_it() -> None:
    labelled = [s for s in all_settings() if s.info.label]
    assert [f.setting for f in fields()] == labelled and len(labelled) > 30
    names = [name for f in fields() for name in f.properties()]
    assert len(set(names)) == len(names)
    for field in fields():
        own = f"{field.setting.section}_{field.setting.key}"
        assert field.name == own and all(name.startswith(own) for name in field.properties())
    assert {"render_lens_mm", "heads_source_folder", "render_distance_mm_unset", "poses_yaw"} < set(names)
    # Those without a label could be shown, too.
    for other in all_settings():
        assert field_of(other).properties()


def test_words_and_limits_are_those_of_settings_that_exist() -> None:
    names = {s.name for s in all_settings()}
    assert {name.split(":")[0] for name in (*HELP, *LIMITS, *UNSET)} <= names
    # The limits of the panel are inside those of the plan.
    for name, reach in LIMITS.items():
        axes = {**dict.fromkeys(ANGLES, (0, 0, 1)), name.split(".")[1]: (0, reach, reach)}
        assert len(grid_plan(**axes)) == 2
    assert titled("Same poses for every head") == "Same Poses for Every Head"
    assert (titled("CSV file"), titled("Min. confidence")) == ("CSV File", "Min. Confidence")


def test_properties_follow_from_the_table() -> None:
    made = {name: p for f in fields() for name, p in f.properties().items()}
    lens = made["render_lens_mm"]
    assert lens.kind == "FloatProperty"
    assert lens.options["description"] == "Focal length on a 36 mm sensor (mm)"
    assert (lens.options["min"], lens.options["max"], lens.options["default"]) == (10, 1000, 85)
    assert made["render_resolution"].kind == "IntProperty"
    assert made["render_background"].options["subtype"] == "COLOR_GAMMA"
    assert made["render_ambient"].options["subtype"] == "FACTOR"
    assert made["landmarks_min_confidence"].options["min"] > 0
    assert made["poses_path"].options["subtype"] == "FILE_PATH"
    assert made["heads_source_folder"].options["subtype"] == "DIR_PATH"
    assert made["render_distance_mm_unset"].options["name"] == "Frame Each Head"
    units = [item[0] for item in made["heads_units"].options["items"]]
    assert units == ["GUESS", "um", "mm", "cm", "dm", "m"]
    assert made["poses_yaw"].options["max"] == 89.9 and made["poses_yaw"].options["size"] == 3
    assert made["poses_same"].kind == "BoolProperty"
    assert ("uv", "UV", "") in made["dataset_passes"].options["items"]


@dataclass(frozen=True)
class Odd:
    """Settings of every kind there could be."""

    count: int | None = setting(None, "Count", low=2, label="Count")
    more: int = setting(5, "More", above=4, label="More")
    both: bool | None = setting(None, "Both?", label="Both")
    axis: tuple[float, float] | None = setting(None, "Axis", label="Axis")
    steps: tuple[int, ...] = setting((1, 2), "Steps", label="Steps")
    passes: tuple[str, ...] = setting((), "Some", choices=(Choice("b"), Choice("a")), label="Passes")
    colour: tuple[float, float, float] = setting((0.0, 0.5, 1.0), "Colour", low=0, high=1, label="Colour")
    note: str | None = setting(None, "Note", label="Note")


def test_settings_of_any_kind_go_there_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SECTIONS, "odd", Odd)
    for values in (
        {"more": 5, "steps": [1, 2], "passes": [], "colour": [0, 0.5, 1]},
        {"count": 3, "more": 7, "both": False, "axis": [0.1, -2], "steps": [3, 4], "passes": ["a", "b"],
         "colour": [0.25, 0, 1], "note": "x"},
        {"both": True, "more": 6, "steps": [0, 0], "passes": ["a"], "colour": [1, 1, 1]},
    ):  # fmt: skip
        assert round_trip({"odd": values})["odd"] == values
        properties = Properties({"odd": values})
        assert properties["odd_count_unset"] == ("count" not in values)
        assert properties["odd_both"] == {None: "GUESS", True: "YES", False: "NO"}[values.get("both")]
    kinds = {s.key: [p.kind for p in field_of(s).properties().values()] for s in section_settings("odd", Odd)}
    assert kinds["axis"] == ["FloatVectorProperty", "BoolProperty"] and kinds["steps"] == [
        "IntVectorProperty"
    ]
    options = Properties().options
    assert options["odd_more"]["min"] == 5
    assert options["odd_count"]["default"] == 2, "a number that is not given starts within its limits"


def test_a_kind_nobody_knows_is_named() -> None:
    for kind in (dict[str, int], tuple[float, ...] | None):
        strange = Setting("strange", "table", kind, None, Info("Table", label="Table"))
        with pytest.raises(TypeError, match=r"strange\.table: Blender has no property"):
            field_of(strange)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"poses": {"kind": "uniform", "count": 7}},
        {"poses": {"kind": "sobol", "yaw": [0, 1], "pitch": [-50.0, 50, 10], "same": True}},
        {"heads": {"source": "/heads", "units": "cm", "up": "+Z", "subjects": ["a", "b, c"]}},
        {"render": {"distance_mm": 712.345678, "samples": 9, "background": [0.1, 0.2, 1.0]}},
        {"landmarks": {"min_confidence": 0.123456789, "detector": "mediapipe"}},
        {"dataset": {"passes": ["depth"], "unit_size": 7}, "heads": {"license": "CC0"}},
    ],
)
def test_what_the_panel_says_is_what_the_file_said(told: Values, tmp_path: Path) -> None:
    """And so is what the command line makes of it."""
    config.write_config(round_trip(told), tmp_path / "c.toml")
    assert load_config(tmp_path / "c.toml", {}) == load_config(None, told)
    resolved = tomllib.loads(config_toml(load_config(None, told)))
    assert round_trip(resolved) == {name: table for name, table in resolved.items() if table}


def test_a_file_that_names_nothing_leaves_the_defaults() -> None:
    shown = round_trip({})
    assert "distance_mm" not in shown["render"] and "units" not in shown["heads"]
    assert section_of(shown, "render") == Render() and section_of(shown, "poses") == BuildConfig().poses


def test_settings_that_no_panel_shows_are_kept() -> None:
    told: Values = {
        "landmarks": {"detector": "other"},
        "render": {"distance_mm": 500.0},
        "heads": {"license": "X"},
    }
    properties = Properties(told)
    properties["render_resolution"], properties["render_distance_mm_unset"] = 64, True
    found = configuration(properties.getter, told)
    assert found["landmarks"]["detector"] == "other" and found["heads"]["license"] == "X"
    assert found["render"]["resolution"] == 64 and "distance_mm" not in found["render"]


def test_digits_that_blender_cannot_hold_are_kept() -> None:
    told: Values = {
        "poses": {"yaw": [-33.3333333333, 50, 10]},
        "render": {"margin": 1.1000000001, "lens_mm": 85.0},
    }
    found = round_trip(told)
    assert found["poses"]["yaw"] == told["poses"]["yaw"] and found["render"]["margin"] == 1.1000000001
    properties = Properties(told)
    properties["poses_yaw"] = (-33.3334, 50, 10)
    assert configuration(properties.getter, told)["poses"]["yaw"] == [-33.3334, 50, 10]


def test_what_means_nothing_here_is_left_out() -> None:
    """Units would make parametric heads of another size."""
    told: Values = {
        "heads": {"source": "/heads", "units": "cm", "count": 5},
        "poses": {"kind": "csv", "path": "/p"},
    }
    properties = Properties(told)
    found = configuration(properties.getter, told)
    # It meant nothing in the file: it is the file's.
    assert found["heads"]["count"] == 5 and "seed" not in found["heads"] and "yaw" not in found["poses"]
    properties["heads_source"], properties["poses_kind"] = "parametric", "grid"
    found = configuration(properties.getter, told)
    assert "units" not in found["heads"] and "path" not in found["poses"]
    assert found["heads"]["count"] == 5 and found["heads"]["seed"] == 0 and len(found["poses"]["yaw"]) == 3


def test_a_grid_that_becomes_random_loses_its_step() -> None:
    told: Values = {"poses": {"yaw": [-30, 30, 30]}}
    properties = Properties(told)
    properties["poses_kind"] = "uniform"
    found = configuration(properties.getter, told)["poses"]
    assert found["yaw"] == [-30, 30] and found["pitch"] == [-40, 40, 10]
    assert load_config(None, {"poses": found}).poses.pitch == BuildConfig().poses.pitch


def test_what_a_maker_is_told_is_kept() -> None:
    told: Values = {"heads": {"source": "parametric:adults"}}
    assert Properties(told)["heads_source"] == "parametric"
    assert round_trip(told)["heads"]["source"] == "parametric:adults"


def test_the_folder_of_a_maker_is_shown_and_told() -> None:
    told: Values = {"heads": {"source": "ict:/data/kit"}}
    properties = Properties(told)
    assert (properties["heads_source"], properties["heads_source_folder"]) == ("ict", "/data/kit")
    assert round_trip(told)["heads"]["source"] == "ict:/data/kit"
    properties["heads_source_folder"] = "/data/other"
    assert configuration(properties.getter, told)["heads"]["source"] == "ict:/data/other"
    assert asks_for_folder("ict") and asks_for_folder(FOLDER) and not asks_for_folder("parametric")


@pytest.mark.parametrize(
    "table",
    [
        {"render": {"resolution": 8000}},
        {"render": {"lens_mm": 9.0}},
        {"poses": {"yaw": [-95, 0, 1]}},
        {"dataset": {"validation": -0.1}},
        {"landmarks": {"min_confidence": 0}},
    ],
)
def test_what_no_property_can_say_is_named(table: Values) -> None:
    [section], [keys] = table, [list(values) for values in table.values()]
    with pytest.raises(ValueError, match=rf"{section}\.{keys[0]}: the panel cannot show"):
        round_trip(table)


def test_paths_count_from_the_file_that_names_them(tmp_path: Path) -> None:
    found = located({"heads": {"source": "faces"}, "poses": {"path": "/p.csv"}}, tmp_path)
    assert found == {"heads": {"source": str(tmp_path / "faces")}, "poses": {"path": "/p.csv"}}
    kit = located({"heads": {"source": "ict:kit"}}, tmp_path)["heads"]["source"]
    assert kit == f"ict:{tmp_path / 'kit'}"
    assert located({"heads": {"source": "parametric"}}, tmp_path)["heads"]["source"] == "parametric"


def test_names_in_a_field_are_separated_by_commas() -> None:
    assert config.split_names(' anna,  "Lee, Perry" ,3 ') == ["anna", "Lee, Perry", "3"]
    assert config.split_names(config.join_names(["a", 'b "x", c'])) == ["a", 'b "x", c']
    assert config.split_names(" , ") is None and config.join_names([]) == ""


def test_what_is_written_is_what_the_command_line_reads(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    values = {
        "heads": {"source": 'a "b" \\ ü\x7f', "subjects": ["1", "x"]},
        "poses": {"kind": "uniform", "yaw": [-0.1, 50], "count": 7, "same": True},
        "render": {"ambient": config.number(0.10000000149011612), "background": [0, 0.5, 1]},
        "dataset": {"images": "none"},
    }
    config.write_config(values, path)
    assert config.read_config(path) == values == tomllib.loads(path.read_text(encoding="utf-8"))
    read = load_config(path, {})
    assert read.render.ambient == 0.1 and read.heads.source == values["heads"]["source"]
    with pytest.raises(UsageError, match="choose another place"):
        config.write_config(values, tmp_path / "nowhere" / "c.toml")


@pytest.mark.parametrize("text", ["[render", "[unknown]\na = 1", "render = 3"])
def test_a_bad_configuration_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=r"bad\.toml"):
        config.read_config(path)


def test_numbers_have_their_units() -> None:
    """Angles are shown in radians, which Blender writes as degrees; see units.py."""
    options = Properties().options
    assert (
        options["render_lens_mm"]["subtype"]
        == options["heads_eye_distance_mm"]["subtype"]
        == "DISTANCE_CAMERA"
    )
    assert options["render_resolution"]["subtype"] == options["render_defocus_px"]["subtype"] == "PIXEL"
    drawn = {field.name: field.drawn for field in fields()}
    assert drawn["render_light_yaw_deg"] == "render_light_yaw_deg_angle"
    assert drawn["poses_yaw"] == "poses_yaw_angle" and drawn["render_lens_mm"] == "render_lens_mm"


def test_files_that_may_be_dropped_are_those_that_are_read() -> None:
    assert MESHES == SUFFIXES

# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel shows: its rows, its lines, the gallery's window, a build."""

from __future__ import annotations

import os
from dataclasses import make_dataclass
from pathlib import Path
from typing import Any

import pytest

from blender_addon.core import gallery, panel
from blender_addon.core.build import Build, newest_image
from blender_addon.core.conversation import Conversation
from blender_addon.core.found import Listing, Placed, Points
from blender_addon.core.panel import Line
from blender_addon.core.state import State
from generator.plan.setting import setting
from generator.plan.settings import SECTIONS, Values, all_settings

BELOW = ("", panel.SELECTION, panel.LAMPS, panel.WORN, panel.SENSOR)


def names(sections: tuple[str, ...], values: Values, *below: str) -> list[str]:
    """Of the settings in a panel, or in several."""
    return [row.field.name for one in below or ("",) for row in panel.rows(sections, values, one)]


def test_every_setting_with_a_label_is_in_one_panel() -> None:
    places = [("heads",), ("poses",), ("render",), panel.other_sections()]
    kinds: list[Values] = [{}, {"heads": {"source": "/f"}}]
    kinds += [{"poses": {"kind": "csv"}}, {"poses": {"kind": "sobol"}}]
    for place in places:
        for values in kinds:
            shown = names(place, values, *BELOW)
            assert len(shown) == len(set(shown)), "each stands in one panel"
        seen = {name for values in kinds for name in names(place, values, *BELOW)}
        assert seen == {f"{s.section}_{s.key}" for s in all_settings() if s.info.label and s.section in place}
    assert {section for place in places for section in place} == {*SECTIONS}


def test_rows_are_what_means_something_in_the_order_of_the_table() -> None:
    made = ["heads_source", "heads_count", "heads_seed", "heads_sampled_expressions"]
    assert names(("heads",), {}) == made
    assert names(("heads",), {}, panel.SELECTION) == ["heads_subjects", "heads_expressions"]
    folder: Values = {"heads": {"source": "/faces"}}
    assert names(("heads",), folder) == ["heads_source"]
    meshes = ["heads_units", "heads_eye_distance_mm", "heads_up", "heads_forward"]
    assert names(("heads",), folder, panel.SELECTION)[2:] == [
        "heads_license",
        "heads_redistributable",
        *meshes,
    ]
    assert names(("poses",), {"poses": {"kind": "csv"}}) == ["poses_kind", "poses_path", "poses_frame"]
    drawn = panel.rows(("poses",), {"poses": {"kind": "uniform", "yaw": [-50, 50, 10]}})
    parts = {row.field.setting.key: row.parts for row in drawn}
    assert parts == {
        "kind": 0, "yaw": 2, "pitch": 2, "roll": 2, "count": 0, "seed": 0, "same": 0, "frame": 0
    }  # fmt: skip
    assert [row.header for row in drawn if row.parts] == [("From", "To"), (), ()]
    gridded = panel.rows(("poses",), {"poses": {"kind": "grid"}})
    assert [(row.parts, row.header) for row in gridded if row.parts] == [
        (3, ("From", "To", "Step")), (3, ()), (3, ()),
    ]  # fmt: skip
    look = names(("render",), {})
    assert {"render_samples", "render_margin"} < set(look)
    assert names(("render",), {}, panel.SENSOR)[0] == "render_exposure_ev"
    assert names(("render",), {}, panel.WORN)[0] == "render_hair"
    assert names(("render",), {}, panel.LAMPS)[0] == "render_lamp1_yaw_deg"
    assert "dataset_passes" in names(panel.other_sections(), {})
    assert look[:3] == ["render_variety", "render_resolution", "render_lens_mm"]
    assert look[-1] == "render_backdrop"
    assert names(panel.other_sections(), {})[0] == "landmarks_min_confidence"


def test_a_section_more_stands_beside_the_build_button(monkeypatch: pytest.MonkeyPatch) -> None:
    video = make_dataclass("Video", [("rate", int, setting(25, "Rate", label="Rate"))], frozen=True)
    monkeypatch.setitem(SECTIONS, "video", video)
    assert names(panel.other_sections(), {})[-1] == "video_rate"


def test_what_went_wrong_comes_before_what_is_going_on() -> None:
    state = State()
    conversation = Conversation(state, lambda: pytest.fail(), lambda: None, lambda: None)
    assert panel.going_on(conversation) is None
    state.checking = True
    assert panel.going_on(conversation) == Line("looking for Headturn...", "SORTTIME")
    state.error = "no face"
    assert panel.going_on(conversation) == Line("no face", "ERROR")


def test_lines_of_the_heads() -> None:
    heads = [("a", "neutral"), ("a", "smile"), ("b", "neutral")]
    assert panel.found(Listing(heads)).text == "3 heads of 2 subjects"
    assert panel.in_view(None, ("a", "neutral"), "these") == []
    placed = Placed(("a", "neutral"), "these", 12345, ["units guessed"])
    assert Placed.read(placed.text()) == placed and Placed.read("") is None
    lines = [line.text for line in panel.in_view(placed, ("a", "neutral"), "these")]
    assert lines == ["12,345 vertices", "units guessed"]
    assert [line.text for line in panel.in_view(placed, ("b", "neutral"), "these")] == ["in view: a neutral"]
    [other] = panel.in_view(placed, ("a", "neutral"), "others")
    assert other.text.startswith("in view: a neutral, of other heads than those named above")
    skipped = Listing(skipped=["1", "2", "3"])
    assert [line.text for line in panel.left_out(skipped)] == ["left out: 1", "left out: 2", "left out: 3"]
    assert panel.left_out(Listing(skipped=[*"12345"]))[-1] == Line("and 2 more left out", "BLANK1")
    assert panel.landmarks(None) is None
    assert panel.landmarks(Points(None)) == Line("no face was found at this pose", "ERROR")
    assert panel.landmarks(Points([[1.0, 2.0]] * 468)) == Line("468 landmarks found", "CHECKMARK")


def test_what_snapping_needs() -> None:
    assert panel.snap({}) is None and panel.snap({"poses": {"kind": "grid"}}) is None
    assert panel.snap({"poses": {"kind": "csv"}}) == Line("Snap needs Dataset Poses: Grid", "INFO")


def test_how_many_poses() -> None:
    assert panel.pose_count({}) == Line("693 poses a head", "INFO")
    assert panel.pose_count({"poses": {"kind": "sobol", "count": 1234}}).text == "1,234 poses a head"
    assert panel.pose_count({"poses": {"kind": "uniform", "count": 12}}).text == "12 poses a head"
    line = panel.pose_count({"poses": {"yaw": [0, 10, 3]}})
    assert line.icon == "ERROR" and "does not divide" in line.text
    assert panel.pose_count({"poses": {"kind": "csv"}}).text == "choose the CSV file of the poses"


def test_the_window_of_the_gallery() -> None:
    heads = [(f"p{k:03}", "neutral") for k in range(200)]
    around = gallery.window(heads, heads[100])
    assert (around.start, around.stop) == (50, 151)
    assert list(gallery.window(heads, heads[0])) == list(range(51))
    assert list(gallery.window(heads, ("gone", "neutral"))) == list(range(51))
    assert not gallery.window([], heads[0])
    nearest = gallery.nearest(heads, heads[100])
    assert nearest[0] == heads[100] and {*nearest[1:3]} == {heads[99], heads[101]} and len(nearest) == 101
    assert gallery.titles(heads)[0] == "p000"
    assert gallery.titles([("a", "neutral"), ("a", "smile")]) == ["a neutral", "a smile"]


class Process:
    """A host that says what the test says."""

    pid = 1

    def __init__(self) -> None:
        self.events: list[dict[str, Any]] = []
        self.log: list[str] = []
        self.exit_code: int | None = None
        self.interrupted = self.closed = False

    def poll(self) -> list[dict[str, Any]]:
        events, self.events = self.events, []
        return events

    def interrupt(self) -> None:
        self.interrupted = True

    def close(self) -> None:
        self.closed = True


def picture(path: Path, stamp: int) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    os.utime(path, (stamp, stamp))
    os.utime(path.parent, (stamp, stamp))
    return path


def test_a_build_that_ends_well(tmp_path: Path) -> None:
    build, process = Build(), Process()
    assert panel.outcome(build) is None and not build.poll()
    build.start(process, tmp_path)
    assert build.runs and not build.poll()
    process.events = [
        {"event": "note", "text": "making heads"},
        {"event": "progress", "stage": "rendering", "done": 5, "total": 10, "rate": 2, "eta_s": 2.5},
    ]
    assert build.poll()
    assert panel.outcome(build) == Line("rendering 5 of 10 · 2.0/s · 0:02 left", "INFO")
    picture(tmp_path / "images" / "a" / "1.png", 1)
    last = picture(tmp_path / "images" / "b" / "2.png", 2)
    process.events, process.log = [{"event": "finished", "rows": 10, "detection_rate": 1.0}], ["bye"]
    process.exit_code = 0
    assert build.poll() and not build.runs and process.closed and build.newest == last
    assert panel.outcome(build) == Line("done: 10 images, 100% detected", "INFO")
    assert build.report.splitlines() == [
        str(tmp_path), "done (exit code 0): 10 images, 100% detected", "",
        "Notes", "  making heads", "", "Log", "  bye", "",
    ]  # fmt: skip
    build.start(Process(), tmp_path)
    assert build.report == "" and build.newest is None and build.exit_code is None


@pytest.mark.parametrize(
    ("code", "log", "said"),
    [
        (1, ["x", "headturn: the disk is full"], "failed: the disk is full"),
        (2, [], "wrong use: the host printed nothing"),
        (9, ["killed"], "ended with exit code 9: killed"),
    ],
)
def test_a_build_that_fails(code: int, log: list[str], said: str, tmp_path: Path) -> None:
    build, process = Build(), Process()
    build.start(process, tmp_path)
    process.log, process.exit_code = log, code
    assert build.poll() and panel.outcome(build) == Line(said, "ERROR")


def test_a_build_that_is_cancelled_or_refused(tmp_path: Path) -> None:
    build, process = Build(), Process()
    build.cancel()
    assert not build.cancelled, "nothing runs"
    build.start(process, tmp_path)
    build.cancel()
    assert process.interrupted and build.headline() == "stopping..."
    process.exit_code = 143
    build.poll()
    assert build.headline() == "stopped: Build continues where it ended"
    assert build.report.splitlines()[1].startswith("stopped (exit code 143)")
    build.forget()
    build.expect(tmp_path)
    assert build.runs and build.headline() == "starting"
    build.cancel()
    assert not build.runs and build.cancelled and panel.outcome(build) is None
    build.expect(tmp_path)
    build.refuse("no host")
    assert not build.runs and panel.outcome(build) == Line("no host", "ERROR")


def test_the_newest_image(tmp_path: Path) -> None:
    assert newest_image(tmp_path / "none") is None
    (tmp_path / "empty").mkdir()
    assert newest_image(tmp_path / "empty") is None
    picture(tmp_path / "d" / "a" / "1.png", 5)
    old = picture(tmp_path / "d" / "b" / "1.png", 7)
    picture(tmp_path / "d" / "b" / ".half.png", 9)
    assert newest_image(tmp_path / "d") == old

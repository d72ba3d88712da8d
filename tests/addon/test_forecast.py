# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a build will be, and what the panel says of it."""

from __future__ import annotations

import csv
from pathlib import Path

from blender_addon.core.build import Build
from blender_addon.core.forecast import (
    PER_CORE_S,
    Amount,
    Rate,
    amount,
    forecast,
    guess,
    likeness,
    load,
    rate_of,
    save,
)
from blender_addon.core.found import NOTHING, Listing
from blender_addon.core.progress import Progress, Told

ROOT = Path(__file__).resolve().parents[2]
HEADS = Listing([("anna", "neutral"), ("anna", "smile"), ("bert", "neutral")])


def lines(values: dict, listing: Listing = NOTHING) -> str:
    much = amount(values, listing)
    assert much is not None
    return much.line()


def test_images_are_heads_times_poses() -> None:
    assert lines({"heads": {"count": 3}}) == "3 heads x 693 poses = 2,079 images"
    assert lines({"heads": {"count": 2, "sampled_expressions": 1}}) == "4 heads x 693 poses = 2,772 images"
    still = {name: [0, 0, 10] for name in ("yaw", "pitch", "roll")}
    folder = {"heads": {"source": "/scans"}, "poses": still}
    assert lines(folder) == "1 image a head; Load Heads counts the heads"
    assert lines(folder, HEADS) == "3 heads x 1 pose = 3 images"
    assert lines({"poses": {"kind": "sobol", "count": 64}, "heads": {"count": 1}}).endswith("= 64 images")
    twins = {"heads": {"count": 1}, "dataset": {"twins": ["light", "background"], "twins_share": 0.5}}
    assert lines(twins) == "1 head x 693 poses, with 1 twin each, = 1,386 images"
    assert amount({"poses": {"kind": "csv", "path": "/nowhere.csv"}}, HEADS) is None


def test_time_and_space_rest_on_the_last_build(tmp_path: Path) -> None:
    much = Amount(3, 693, 0)
    like, pixels = likeness({}, 0)
    assert pixels == 256**2 and forecast(much, like, pixels, None) == ""
    last = Rate(50.0, 33_000.0, 10_000.0, pixels, like)
    assert forecast(much, like, pixels, last) == "about 42 s, 89 MB, at the rate of your last build"
    other, small = likeness({"render": {"preset": "quality", "resolution": 128}}, 0)
    assert (other == like, small) == (False, 128**2)
    said = forecast(Amount(3_000, 693, 0), other, pixels * 4, last)
    assert said == "about 46:12:00, 295.2 GB, at the rate of your last build, which had other settings"
    save(last, tmp_path / "rate.json")
    assert load(tmp_path / "rate.json") == last and load(tmp_path / "none.json") is None
    (tmp_path / "rate.json").write_text("[]")
    assert load(tmp_path / "rate.json") is None


def test_before_a_first_build_it_is_guessed() -> None:
    much, pixels = Amount(3, 693, 0), 256**2
    said = forecast(much, "like", pixels, guess({}, 2))
    assert said == "roughly 37 s, 94 MB; better known after a first build"
    slower = [
        guess({"render": {"preset": "quality"}}, 2),
        guess({"render": {"variety": "photo"}}, 2),
        guess({}, 1),
    ]
    assert all(one is not None and one.per_s < 56 for one in slower)
    assert guess({"heads": {"source": "/my/scene.blend"}}, 2) is None, "its engine has its own speed"


def test_the_guess_is_what_was_measured() -> None:
    """Within a factor of two of every line of the history that says what two cores do."""
    with (ROOT / "benchmarks" / "history.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["figure"].endswith(", local")]
    assert {row["figure"].partition(",")[0] for row in rows} == set(PER_CORE_S)
    for row in rows:
        cores = int(row["machine"].partition(" x ")[0])
        guessed = guess({"render": {"preset": row["figure"].partition(",")[0]}}, cores)
        assert guessed is not None and 0.5 < guessed.per_s / float(row["value"]) < 2, row


def test_a_build_says_its_rate(tmp_path: Path) -> None:
    images = tmp_path / "images" / "anna"
    images.mkdir(parents=True)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "part.parquet").write_bytes(bytes(1000))
    for k in range(4):
        (images / f"{k}.png").write_bytes(bytes(100 + k % 2 * 100))
    build = Build(out=tmp_path, newest=images / "3.png")
    assert rate_of(build, "like", 64) is None
    for done in (99, 100):
        told = {"stage": "rendering", "done": done, "total": 100, "rate": 8.0, "eta_s": 0}
        build.progress.take({"event": "progress", **told})
        build.progress.take({"event": "stage", "stage": "writing tables", "total": 1})
        build.progress.take({"event": "finished", "rows": 100, "detection_rate": 1.0})
        expected = Rate(8.0, 150.0, 10.0, 64, "like") if done == 100 else None
        assert rate_of(build, "like", 64) == expected, "few images tell nothing of many"


def test_lines_for_those_who_read_them() -> None:
    progress, told = Progress(), Told()
    assert told.new(progress) == []
    progress.take({"event": "note", "text": "no hair"})
    progress.take({"event": "stage", "stage": "rendering", "total": 3})
    assert told.new(progress) == ["no hair", "rendering 0 of 3"]
    progress.take({"event": "progress", "stage": "rendering", "done": 1, "total": 3, "rate": 0, "eta_s": 0})
    assert told.new(progress) == [], "a line every few seconds"

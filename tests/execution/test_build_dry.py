# SPDX-License-Identifier: GPL-3.0-or-later
"""The build engine without a renderer: plan, commit, resume, leave out what cannot be built."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from dry_build import DryBuild
from no_renderer import MESH, NoRenderer

from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import MANIFEST_FILE, read_manifest
from generator.errors import DatasetError, HeadError, WorkerError
from generator.execution.build.folder import FAILURES_FILE
from generator.execution.build.receipts import RECEIPTS_FILE
from generator.execution.build.run import is_finished
from generator.execution.lanes.slot import ATTEMPTS
from generator.execution.status import LOG_FILE
from generator.messages import BuildOrder, LaneOrder, PlaceOrder


class Halt(BaseException):
    """What a signal raises in the middle of a build."""


def stops_after(units: int) -> NoRenderer:
    """Lanes of a build that is interrupted when so many units are committed."""
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if len(lanes.built) == units:
            raise Halt

    lanes.before = before  # type: ignore[method-assign]
    return lanes


def breaks_at(subject: str) -> NoRenderer:
    """Lanes whose render worker never survives one head."""
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if isinstance(order, BuildOrder) and order.head.subject == subject:
            raise WorkerError("Blender was killed by signal 11", "line 1\nline 2")

    lanes.before = before  # type: ignore[method-assign]
    return lanes


def test_a_build_from_nothing(tmp_path: Path) -> None:
    dry = DryBuild(tmp_path, "amy", "bob")
    result = dry.build()
    assert [path.name for path in result.pictures if path.stat().st_size > 5000] == ["detection_rate.png"]
    assert result.complete
    assert dry.said.stages == {"looking at the first heads": 2, "placing heads": 2, "rendering": 12}
    assert [len(order.views) for order in dry.lanes.built] == [4, 2, 4, 2], "head by head, chunk by chunk"
    assert [kind for kind, _ in dry.said.events] == ["unit"] * 4
    assert sorted(dry.rendered) == [row["sample_id"] for row in dry.rows]
    assert is_finished(dry.config(), dry.root)
    assert not is_finished(dry.config(poses={"yaw": [0, 30, 10]}), dry.root)
    assert "rendering: 12" in (dry.root / LOG_FILE).read_text()
    dry.check()


@pytest.mark.parametrize("images", ["files", "embedded"])
def test_a_build_with_images(dry: DryBuild, images: str) -> None:
    result = dry.build(dataset={"images": images, "image_format": "jpg" if images == "files" else "png"})
    files = sorted(p.relative_to(dry.root).as_posix() for p in (dry.root / "images").rglob("*.jpg"))
    assert files == ([f"images/{row['sample_id']}.jpg" for row in dry.rows] if images == "files" else [])
    assert "contact_sheet.png" in {path.name for path in result.pictures}
    dry.check()


def test_a_second_build_does_nothing(dry: DryBuild) -> None:
    dry.build()
    digest, parts = dry.digest, dry.parts
    dry.build()
    assert not dry.lanes.built and not dry.lanes.placed
    assert any("4 of 4 units are already there" in note for note in dry.said.notes)
    assert (dry.digest, dry.parts) == (digest, parts)
    dry.check()


@pytest.mark.parametrize("units", [0, 1, 3])
def test_an_interrupted_build_goes_on_where_it_stopped(dry: DryBuild, tmp_path: Path, units: int) -> None:
    with pytest.raises(Halt):
        dry.build(lanes=stops_after(units))
    before = dry.rendered
    assert not (dry.root / MANIFEST_FILE).exists(), "it is not finished, and says so"
    dry.build()
    assert not set(before) & set(dry.rendered), "nothing is rendered twice"
    dry.check()
    whole = DryBuild(tmp_path / "whole", "amy", "bob")
    whole.build()
    assert dry.digest == whole.digest
    assert dry.parts == whole.parts


@pytest.mark.parametrize("damage", ["gone", "cut", "grown", "with more rows"])
def test_a_damaged_part_is_built_again(dry: DryBuild, damage: str) -> None:
    dry.build()
    digest = dry.digest
    parts = sorted(read_manifest(dry.root).parts, key=lambda part: part.rows)
    first, second = (dry.root / part.path for part in (parts[0], parts[-1]))
    match damage:
        case "gone":
            first.unlink()
        case "cut":
            first.write_bytes(first.read_bytes()[:-100])
        case "grown":
            first.write_bytes(first.read_bytes() + b"x")
        case _:
            first.write_bytes(second.read_bytes())
    dry.build()
    assert [order.part_path for order in dry.lanes.built] == [first.relative_to(dry.root).as_posix()]
    assert dry.digest == digest
    dry.check()


def test_without_receipts_every_part_is_read_and_none_is_rendered(dry: DryBuild) -> None:
    dry.build()
    (dry.root / RECEIPTS_FILE).unlink()
    dry.build()
    assert not dry.lanes.built
    dry.check()


def test_a_head_that_cannot_be_placed_is_left_out(dry: DryBuild) -> None:
    lanes = NoRenderer()
    lanes.bad_heads["bob/neutral"] = "no face was found from the front"
    result = dry.build(lanes=lanes)
    assert not result.complete and not is_finished(dry.config(), dry.root)
    assert [(s.subject, s.reason) for s in result.skipped] == [("bob", "no face was found from the front")]
    assert list(result.manifest.skipped) == [
        {"head": "bob/neutral", "reason": "no face was found from the front"}
    ]
    assert [head.subject for head in read_heads(dry.root)] == ["amy"]
    dry.check()
    dry.build()
    assert not dry.lanes.placed and not dry.lanes.built, "the same file is not looked at again"
    (dry.heads / "bob" / "neutral.obj").write_text(MESH + "# mended\n")
    assert dry.build().complete
    assert {name.split("/")[0] for name in dry.rendered} == {"bob"}
    dry.check()


def test_a_subject_that_breaks_its_lane_is_left_out(dry: DryBuild) -> None:
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if isinstance(order, PlaceOrder) and order.heads[0].subject == "amy":
            raise HeadError("amy/neutral.obj: not a mesh")

    lanes.before = before  # type: ignore[method-assign]
    result = dry.build(lanes=lanes)
    assert [(s.subject, s.reason) for s in result.skipped] == [("amy", "amy/neutral.obj: not a mesh")]
    assert "skipped amy/neutral: amy/neutral.obj: not a mesh" in dry.said.notes
    dry.check()


def test_every_note_about_a_head_is_said_once(dry: DryBuild) -> None:
    """What ``heads list`` knows: of the files, and of the mesh."""
    assert dry.build().complete
    [licence] = [note for note in dry.said.notes if "licence" in note]
    assert licence == "amy/neutral and 1 more: licence unknown"
    dry.check()


def test_without_a_head_nothing_is_built(dry: DryBuild) -> None:
    lanes = NoRenderer()
    lanes.bad_heads.update({"amy/neutral": "too small", "bob/neutral": "too large"})
    with pytest.raises(HeadError, match="none of its heads can be built; the first: too small"):
        dry.build(lanes=lanes)
    assert not is_finished(dry.config(), dry.root)
    for subject in ("amy", "bob"):
        (dry.heads / subject / "neutral.obj").write_text(MESH + "# mended\n")
    dry.build(render={"resolution": 32})  # nothing was rendered, so any configuration may be tried next
    dry.check()


def test_a_unit_that_always_breaks_is_quarantined(dry: DryBuild) -> None:
    result = dry.build(lanes=breaks_at("bob"))
    assert not result.complete and result.failed_units == 2 and result.manifest.failures == 2
    failures = [json.loads(line) for line in (dry.root / FAILURES_FILE).read_text().splitlines()]
    assert [(f["subject"], f["poses"], f["attempts"]) for f in failures] == [
        ("bob", 4, ATTEMPTS),
        ("bob", 2, ATTEMPTS),
    ]
    assert failures[0]["log"] == ["line 1", "line 2"]
    assert [kind for kind, _ in dry.said.events] == ["unit", "unit", "quarantined", "quarantined"]
    assert result.manifest.rows == 6

    dry.build()
    assert {name.split("/")[0] for name in dry.rendered} == {"bob"}
    assert not (dry.root / FAILURES_FILE).exists()
    dry.check()


def test_where_no_unit_can_be_built_there_is_no_dataset(dry: DryBuild) -> None:
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if isinstance(order, BuildOrder):
            raise WorkerError("Blender was killed by signal 11")

    lanes.before = before  # type: ignore[method-assign]
    with pytest.raises(DatasetError, match="no unit could be built"):
        dry.build(lanes=lanes)
    assert len((dry.root / FAILURES_FILE).read_text().splitlines()) == 4
    assert not (dry.root / MANIFEST_FILE).exists()


def test_a_full_disk_ends_the_build_and_the_next_one_finishes_it(dry: DryBuild) -> None:
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if len(lanes.built) == 1:
            raise DatasetError("no space left on device")

    lanes.before = before  # type: ignore[method-assign]
    with pytest.raises(DatasetError, match="no space left"):
        dry.build(lanes=lanes)
    assert "stopped: DatasetError: no space left on device" in (dry.root / LOG_FILE).read_text()
    dry.build()
    assert len(dry.lanes.built) == 3
    dry.check()


def test_another_configuration_is_refused_with_what_differs(dry: DryBuild) -> None:
    dry.build()
    digest = dry.digest
    with pytest.raises(DatasetError, match=r"another configuration \(render.lens_mm: 85.0 -> 50.0\)"):
        dry.build(render={"lens_mm": 50})
    assert not dry.lanes.placed
    assert dry.digest == digest
    with pytest.raises(DatasetError, match=r"the dataset there will be deleted; nothing was changed"):
        dry.build(render={"lens_mm": 50}, fresh=True)
    assert dry.digest == digest
    (dry.root / "notes.txt").write_text("mine")
    dry.build(render={"lens_mm": 50}, fresh=True, confirm=lambda what: True)
    assert len(dry.rendered) == 12 and dry.digest != digest
    assert (dry.root / "notes.txt").read_text() == "mine"
    dry.check()


def test_a_dataset_that_is_moved_with_its_heads_goes_on(
    dry: DryBuild, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    relative = {"source": "../heads"}
    monkeypatch.chdir(dry.heads)
    dry.build(heads=relative)
    moved = tmp_path / "moved"
    moved.mkdir()
    dry.root, dry.heads = dry.root.rename(moved / "dataset"), dry.heads.rename(moved / "heads")
    monkeypatch.chdir(dry.heads)
    dry.build(heads=relative)
    assert not dry.lanes.built
    dry.check()
    with pytest.raises(DatasetError, match=r"heads\.source: '.*heads' -> '.*elsewhere'"):
        dry.build(heads={"source": "elsewhere"})


def test_a_folder_that_is_something_else_is_refused(dry: DryBuild) -> None:
    dry.root.mkdir()
    (dry.root / "thesis.txt").write_text("do not overwrite")
    with pytest.raises(DatasetError, match="not empty and not a Headturn dataset"):
        dry.build()
    assert [path.name for path in dry.root.iterdir()] == ["thesis.txt"]


def test_a_compacted_dataset_is_not_called_something_else(dry: DryBuild) -> None:
    dry.root.mkdir()
    (dry.root / "manifest.json").write_text("{}")
    with pytest.raises(DatasetError, match=r"without its config\.toml, as headturn compact writes them"):
        dry.build()

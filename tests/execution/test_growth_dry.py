# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets that grow and shrink, without a renderer: what is there is never rendered again."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from dry_build import DryBuild
from no_renderer import MESH, NoRenderer

from generator.dataset.format.manifest import MANIFEST_FILE
from generator.errors import DatasetError
from generator.execution.build import run as build_module
from generator.execution.build.receipts import RECEIPTS_FILE
from generator.messages import BuildOrder, LaneOrder

WIDER = {"yaw": [-20, 40, 10]}
"""The grid of SMALL with two more columns at its low end, and two at its high end."""


@pytest.fixture(scope="module")
def digest_at_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """The digest of the same two heads at a range of yaw, built in one go."""

    @cache
    def digest(*yaw: int) -> str:
        other = DryBuild(tmp_path_factory.mktemp("at_once"), "amy", "bob")
        other.build(poses={"yaw": yaw})
        return other.digest

    return digest


def test_a_head_more(dry: DryBuild) -> None:
    dry.build()
    parts = dry.parts
    dry.add("abe", "cat")  # one sorts before the others
    dry.build()
    assert {name.split("/")[0] for name in dry.rendered} == {"abe", "cat"}
    assert set(parts) < set(dry.parts)
    dry.check()


def test_a_grid_that_grows_at_both_ends_renders_only_what_is_new(
    dry: DryBuild, digest_at_once: Callable[..., str]
) -> None:
    dry.build()
    old = {row["sample_id"] for row in dry.rows}
    dry.build(poses=WIDER)
    assert not old & set(dry.rendered) and len(dry.rendered) == 2 * (14 - 6)
    assert any("4 parts taken over without being rendered again" in note for note in dry.said.notes)
    places = {(row["yaw_deg"], row["yaw_index"]) for row in dry.rows}
    assert places == {(10.0 * k - 20, k) for k in range(7)}, "also of the rows that were there"
    dry.check()
    assert dry.digest == digest_at_once(*WIDER["yaw"])


def test_a_grid_that_grows_at_its_high_end_leaves_the_parts_alone(
    dry: DryBuild, digest_at_once: Callable[..., str]
) -> None:
    dry.build()
    stamps = {name: next(dry.root.rglob(name)).stat().st_mtime_ns for name in dry.parts}
    dry.build(poses={"yaw": [0, 40, 10]})
    assert len(dry.rendered) == 2 * 4
    assert stamps == {name: next(dry.root.rglob(name)).stat().st_mtime_ns for name in stamps}
    dry.check()
    assert dry.digest == digest_at_once(0, 40, 10)


def test_a_finer_grid_keeps_the_poses_of_the_coarse_one(
    dry: DryBuild, digest_at_once: Callable[..., str]
) -> None:
    dry.build()
    dry.build(poses={"yaw": [0, 20, 5]})
    assert len(dry.rendered) == 2 * 4
    dry.check()
    assert dry.digest == digest_at_once(0, 20, 5)


@pytest.mark.slow
def test_growing_again_and_again(dry: DryBuild, digest_at_once: Callable[..., str]) -> None:
    for last in (10, 30, 50):
        dry.build(poses={"yaw": [-last, last, 10]})
        dry.check()
    assert len(dry.rendered) == 2 * 2 * 4
    assert dry.digest == digest_at_once(-50, 50, 10)


def test_poses_are_taken_away_only_when_that_was_agreed_to(dry: DryBuild) -> None:
    dry.build()
    digest, asked = dry.digest, []

    def refuse(what: str) -> bool:
        asked.append(what)
        return False

    with pytest.raises(DatasetError, match=r"2 parts .* will be deleted; nothing was changed"):
        dry.build(poses={"yaw": [0, 10, 10]}, confirm=refuse)
    assert len(asked) == 1 and dry.digest == digest
    dry.check()
    dry.build()
    assert not dry.rendered, "nor was it forgotten what is there"
    dry.build(poses={"yaw": [0, 10, 10]}, confirm=lambda what: True)
    assert not dry.rendered, "the poses that stay were built together"
    assert len(dry.rows) == 8
    dry.check()


def test_a_chunk_that_loses_a_pose_is_built_again(dry: DryBuild) -> None:
    """Parts are all or nothing: what is left of a broken one is rendered anew."""
    dry.build()
    dry.build(poses={"yaw": [0, 0, 10], "roll": [0, 0, 10]}, confirm=lambda what: True)
    assert dry.rendered == ["amy/neutral/y+0_p+0_r+0", "bob/neutral/y+0_p+0_r+0"]
    dry.check()


def test_heads_are_taken_away_with_their_images_and_come_back(dry: DryBuild) -> None:
    files = {"images": "files"}
    dry.build(dataset=files)
    digest = dry.digest
    dry.build(dataset=files, heads={"subjects": ["amy"]}, confirm=lambda what: True)
    assert not dry.rendered
    assert [path.name for path in (dry.root / "images").iterdir() if any(path.rglob("*.png"))] == ["amy"]
    dry.check()
    dry.build(dataset=files)
    assert {name.split("/")[0] for name in dry.rendered} == {"bob"} and dry.digest == digest
    dry.check()


def test_images_of_parts_that_got_another_name_stay(dry: DryBuild) -> None:
    dry.build(dataset={"images": "files"})
    stamps = {path: path.stat().st_mtime_ns for path in dry.root.rglob("y*.png")}
    assert len(stamps) == 12
    dry.build(dataset={"images": "files"}, poses=WIDER)
    assert stamps == {path: path.stat().st_mtime_ns for path in stamps}
    dry.check()


def test_a_dataset_that_grows_is_not_finished_until_it_is(dry: DryBuild) -> None:
    dry.build()
    lanes = NoRenderer()

    def before(order: LaneOrder) -> None:
        if isinstance(order, BuildOrder):
            raise KeyboardInterrupt

    lanes.before = before  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        dry.build(poses=WIDER, lanes=lanes)
    assert not (dry.root / MANIFEST_FILE).exists()


@pytest.mark.parametrize("receipts", [True, False], ids=["with receipts", "without"])
def test_parts_of_a_head_that_broke_are_not_deleted(dry: DryBuild, receipts: bool) -> None:
    """Not even when deletion was agreed to: the head may be mended, its renders would be lost."""
    dry.build()
    parts = dry.parts
    if not receipts:
        (dry.root / RECEIPTS_FILE).unlink()
    (dry.heads / "bob" / "neutral.obj").write_text("v 0 0 0\n")
    broken = NoRenderer()
    broken.bad_heads["bob/neutral"] = "neutral.obj: no face"
    with pytest.raises(DatasetError, match=r"was built before but not this time \(neutral\.obj: no face"):
        dry.build(lanes=broken, confirm=lambda what: True)
    assert dry.parts == parts
    (dry.heads / "bob" / "neutral.obj").write_text(MESH)
    assert dry.build().complete
    assert not dry.rendered


def test_a_head_that_changed_is_built_again(dry: DryBuild) -> None:
    dry.build()
    (dry.heads / "bob" / "neutral.obj").write_text(MESH + "# another chin\n")
    with pytest.raises(DatasetError, match=r"2 parts .* will be deleted"):
        dry.build()
    dry.build(confirm=lambda what: True)
    assert {name.split("/")[0] for name in dry.rendered} == {"bob"}
    dry.check()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "done"),
    [
        ("carry_over", 0),
        ("carry_over", 1),
        ("begin", 0),
        ("drop", 0),
        ("drop", 1),
        ("write_poses", 0),
        ("split_done", 0),
    ],
)
def test_a_build_that_is_killed_while_it_grows_does_so_the_next_time(
    dry: DryBuild, digest_at_once: Callable[..., str], monkeypatch: pytest.MonkeyPatch, step: str, done: int
) -> None:
    """Between taking parts over, removing what lay there before, and writing the new poses, or halfway."""
    dry.build()
    whole = getattr(build_module, step)

    def killed(what: Any, *others: Any) -> None:
        if done:
            whole(what[:done], *others)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(build_module, step, killed)
        with pytest.raises(KeyboardInterrupt):
            dry.build(poses=WIDER)
    dry.build(poses=WIDER)
    assert len(dry.rendered) == 2 * (14 - 6)
    dry.check()
    assert dry.digest == digest_at_once(*WIDER["yaw"])

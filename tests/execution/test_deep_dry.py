# SPDX-License-Identifier: GPL-3.0-or-later
"""verify --deep without a renderer: what is chosen, decoded, rendered again, and said."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from dry_build import DryBuild
from replaying import Lanes
from test_replay_dry import change, grey, sha256
from typer.testing import CliRunner

from generator.cli.app import app
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.part import check_part
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError, WorkerError

NAME = "amy/neutral/y+10_p+0_r+10"


def ask(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and what was printed. Raises what the command raises."""
    answer = CliRunner().invoke(app, ["verify", *map(str, arguments)])
    if answer.exception is not None and not isinstance(answer.exception, SystemExit):
        raise answer.exception
    return answer.exit_code, answer.stdout


def forge(dry: DryBuild, content: bytes) -> None:
    """Another image in the place of one, its hash in row, part and manifest."""
    (dry.root / "images" / f"{NAME}.png").write_bytes(content)
    change(dry, NAME, "image_sha256", sha256(content))
    manifest = read_manifest(dry.root)
    parts = tuple(check_part(dry.root / part.path) for part in manifest.parts)
    write_manifest(replace(manifest, parts=parts), dry.root)


@pytest.fixture
def made(dry: DryBuild, again: Lanes) -> DryBuild:
    dry.build(dataset={"images": "files"})
    return dry


def test_all_of_a_good_dataset(made: DryBuild) -> None:
    code, said = ask(made.root, "--deep", "all")
    assert code == 0
    assert "ok    images again" in said
    assert "all rows: 12 images decoded, 12 rendered again and compared" in said
    assert "not proved: that nobody recorded it all anew" in said and "show what was recorded" not in said
    root = verify_dataset(made.root).merkle_root
    assert "not proved" not in ask(made.root, "--deep", "all", "--digest", root)[1]


def test_some_of_it_are_the_same_ones_each_time(made: DryBuild, again: Lanes) -> None:
    def looked_at(*options: str) -> list[str]:
        again.lanes.built.clear()
        code, said = ask(made.root, "--deep", "4", *options)
        assert code == 0 and "4 rows, chosen with seed" in said
        assert "4 images decoded, 4 rendered again and compared" in said
        assert "not proved: that the other images show what was recorded (--deep all)" in said
        return [f"{o.head.name} {v.pose}" for o in again.lanes.built for v in o.views]

    first = looked_at()
    assert first == looked_at()
    assert Counter(name.split("/")[0] for name in first) == {"amy": 2, "bob": 2}
    assert first != looked_at("--seed", "1")
    assert again.opened == 3, "once a command"


def test_a_grey_picture_with_its_hash_fixed_everywhere(made: DryBuild) -> None:
    forge(made, grey())
    assert verify_dataset(made.root).ok, "nothing in the dataset contradicts it"
    code, said = ask(made.root, "--deep", "all")
    assert code == 1
    assert f"FAIL  images again: {NAME}: the image differs: up to 128 of 255 levels" in said
    assert "\nproved" not in said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"rubbish", "is no PNG that can be decoded"),
        (grey((16, 17)), "has 16 x 17 pixels, its row says 16 x 16"),
    ],
)
def test_what_is_no_image_of_its_row_even_where_nothing_can_be_rendered(
    made: DryBuild, again: Lanes, content: bytes, says: str
) -> None:
    forge(made, content)
    again.refused = UsageError("bpy is not installed: pip install it")
    code, said = ask(made.root, "--deep", "all")
    assert code == 1
    assert f"FAIL  images again: {NAME}: images/{NAME}.png {says}" in said


def test_where_nothing_can_be_rendered_images_are_decoded_and_that_is_said(
    made: DryBuild, again: Lanes
) -> None:
    again.refused = UsageError("bpy is not installed: pip install it")
    code, said = ask(made.root, "--deep", "all")
    assert code == 3
    assert "all rows: 12 images decoded, 0 rendered again and compared" in said
    assert "  12 not rendered again: bpy is not installed: pip install it" in said
    assert "not proved: that images show what was recorded" in said
    facts = json.loads(ask(made.root, "--deep", "all", "--json")[1])
    assert facts["ok"] and facts["deep"]["not_rendered"] == {"bpy is not installed: pip install it": 12}


def test_without_a_detector_as_well(made: DryBuild, again: Lanes) -> None:
    def no_detector(_: object) -> None:
        raise WorkerError("MediaPipe Face Mesh cannot be loaded")

    again.lanes.before = no_detector  # type: ignore[method-assign]
    code, said = ask(made.root, "--deep", "3")
    assert code == 3
    assert "3 not rendered again: nothing can be rendered here: MediaPipe Face Mesh cannot be loaded" in said


def test_heads_that_are_gone_are_said_and_found_elsewhere(made: DryBuild, tmp_path: Path) -> None:
    moved = shutil.move(made.heads, tmp_path / "moved")
    code, said = ask(made.root, "--deep", "all")
    assert code == 3
    assert "12 not rendered again" in said and "are not there any more; give the place" in said
    code, said = ask(made.root, "--deep", "all", "--heads", moved)
    assert code == 0 and "12 rendered again" in said
    (Path(moved) / "bob" / "neutral.obj").write_text("v 0 0 0\n")
    code, said = ask(made.root, "--deep", "all", "--heads", moved)
    assert code == 3
    assert "6 rendered again" in said and "6 not rendered again" in said
    assert "neutral.obj: was changed after the build" in said


def test_other_versions_are_named(made: DryBuild, again: Lanes) -> None:
    again.lanes.versions = {**read_manifest(made.root).versions, "light": "9.9"}
    code, said = ask(made.root, "--deep", "2")
    assert code == 0
    assert "  other versions may render other images: light: none then, 9.9 now" in said


def test_it_is_not_done_where_the_rest_is_wrong(made: DryBuild, again: Lanes) -> None:
    (made.root / "images" / f"{NAME}.png").unlink()
    code, said = ask(made.root, "--deep", "all")
    assert code == 1
    assert "not checked, because of the problems above: images again" in said
    assert again.opened == 0


def test_a_dataset_without_images(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "none"})
    code, said = ask(dry.root, "--deep", "2")
    assert "no images are stored, 2 rendered again and compared" in said
    assert code == 1, "the hashes of a build that renders nothing are of nothing"
    assert ": the image differs" in said


@pytest.mark.parametrize("value", ["0", "-1", "some", "1.5", ""])
def test_what_is_no_number_of_rows(made: DryBuild, value: str) -> None:
    with pytest.raises(UsageError, match="expected a number of rows from 1 on, or all"):
        ask(made.root, f"--deep={value}")
    with pytest.raises(UsageError, match="leave --quick out"):
        ask(made.root, "--deep", "1", "--quick")

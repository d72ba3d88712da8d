# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh folders of every shape become subjects and expressions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from small_meshes import plain_obj, textured_obj

from generator.errors import UsageError
from generator.heads.describe import describe_source
from generator.heads.source import find_heads


def names(path: Path, **options: object) -> list[str]:
    return [head.name for head in find_heads(path, **options).heads]  # type: ignore[arg-type]


def test_one_file_one_folder_many_folders(tmp_path: Path) -> None:
    file = plain_obj(tmp_path / "anna" / "head.obj")
    assert names(file) == ["head/neutral"]
    assert names(tmp_path / "anna") == ["anna/neutral"]
    plain_obj(tmp_path / "s10" / "smile.obj")
    plain_obj(tmp_path / "s10" / "neutral.obj")
    plain_obj(tmp_path / "s9" / "deep" / "down" / "head.obj")
    assert names(tmp_path) == ["anna/neutral", "down/neutral", "s10/neutral", "s10/smile"]


def test_unrelated_meshes_in_one_folder_are_subjects(tmp_path: Path) -> None:
    for stem in ("scan10", "scan9"):
        plain_obj(tmp_path / f"{stem}.obj")
    assert names(tmp_path) == ["scan9/neutral", "scan10/neutral"]


def test_equal_folder_names_are_told_apart_and_formats_counted_once(tmp_path: Path) -> None:
    plain_obj(tmp_path / "a" / "mesh" / "head.obj")
    plain_obj(tmp_path / "b" / "mesh" / "head.obj")
    (tmp_path / "b" / "mesh" / "head.fbx").touch()
    source = find_heads(tmp_path)
    assert [head.name for head in source.heads] == ["a-mesh/neutral", "b-mesh/neutral"]
    assert [skip.path.name for skip in source.skipped] == ["head.fbx"]


def test_a_head_json_is_trusted(tmp_path: Path) -> None:
    folder = tmp_path / "x"
    plain_obj(folder / "n.obj")
    plain_obj(folder / "s.obj")
    card = {
        "source": "parametric",
        "subject": "parametric-0001",
        "license": "CC0-1.0",
        "redistributable": True,
        "attribution": "MakeHuman",
        "units": "mm",
        "up": "+Y",
        "forward": "+Z",
        "seed": 7,
        "expressions": {"neutral": "n.obj", "smile": {"file": "s.obj", "weights": [1]}, "gone": "g.obj"},
    }
    (folder / "head.json").write_text(json.dumps(card))
    source = find_heads(tmp_path)
    assert source.kind == "parametric"
    assert [head.name for head in source.heads] == ["parametric-0001/neutral", "parametric-0001/smile"]
    head = source.heads[0]
    assert (head.license, head.redistributable, head.units, head.up, head.forward) == (
        "CC0-1.0",
        True,
        "mm",
        "+Y",
        "+Z",
    )
    assert head.problems == ()
    assert [(skip.expression, "missing" in skip.reason) for skip in source.skipped] == [("gone", True)]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"expressions": {"neutral": 3}}',
        '{"units": "inch", "expressions": {}}',
        '{"subject": "x"}',
    ],
)
def test_a_broken_head_json_costs_its_own_head(tmp_path: Path, text: str) -> None:
    plain_obj(tmp_path / "good" / "head.obj")
    plain_obj(tmp_path / "bad" / "head.obj")
    (tmp_path / "bad" / "head.json").write_text(text)
    source = find_heads(tmp_path)
    assert [head.subject for head in source.heads] == ["good"]
    (skip,) = source.skipped
    assert "head.json" in skip.reason
    assert "\n" not in skip.reason


def test_overrides_and_what_is_unknown(tmp_path: Path) -> None:
    textured_obj(tmp_path / "a")
    (head,) = find_heads(tmp_path).heads
    assert (head.license, head.redistributable, head.units, head.up) == ("unknown", False, None, None)
    assert head.problems == ("licence unknown",)
    assert [file.name for file in head.files] == ["head.obj", "head.mtl", "skin.png"]
    options = {"license": "CC-BY-4.0", "redistributable": True, "units": "cm", "up": "+Z", "forward": "-Y"}
    (head,) = find_heads(tmp_path, **options).heads  # type: ignore[arg-type]
    assert (head.license, head.redistributable, head.units, head.up, head.forward) == tuple(options.values())
    assert head.problems == ()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": "inch"}, "inch"),
        ({"up": "Y"}, "--up"),
        ({"up": "+Y", "forward": "-Y"}, "same axis"),
        ({"expressions": ["smile"]}, "there are: neutral"),
    ],
)
def test_bad_options_are_usage_errors(tmp_path: Path, options: dict[str, object], message: str) -> None:
    plain_obj(tmp_path / "a" / "head.obj")
    with pytest.raises(UsageError, match=message):
        find_heads(tmp_path, **options)  # type: ignore[arg-type]


def test_nothing_there_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file or folder"):
        find_heads(tmp_path / "absent")
    with pytest.raises(UsageError, match="no heads in"):
        find_heads(tmp_path)
    (tmp_path / "facescape_trainset_001_100.zip").touch()
    with pytest.raises(UsageError, match="unpack it first"):
        find_heads(tmp_path)
    (tmp_path / "notes.txt").touch()
    with pytest.raises(UsageError, match="no heads in"):
        find_heads(tmp_path / "notes.txt")


def test_the_list_has_a_row_a_head_and_keeps_going(tmp_path: Path) -> None:
    textured_obj(tmp_path / "good")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "head.obj").write_text("v 1 2\nf 1 1 1\n")
    quick = describe_source(find_heads(tmp_path), deep=False)
    assert [row["subject"] for row in quick] == ["broken", "good"]
    assert all(row["vertices"] is None for row in quick)
    broken, good = describe_source(find_heads(tmp_path), deep=True)
    assert (good["vertices"], good["triangles"], good["texture"], good["vertex_colors"]) == (
        4,
        4,
        [8, 8],
        False,
    )
    assert good["problems"] == ["licence unknown"]
    assert broken["vertices"] is None
    assert "broken/head.obj" in broken["problems"][-1]
    json.dumps([broken, good])

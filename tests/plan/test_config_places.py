# SPDX-License-Identifier: GPL-3.0-or-later
"""From where the paths of a configuration count: its file, the working directory, the dataset's folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from generator.errors import UsageError
from generator.plan.config import (
    BuildConfig,
    config_toml,
    differences,
    load_config,
    read_recorded,
    recorded_config,
)
from generator.plan.head_source import split_path

RELATIVE = '[heads]\nsource = "scans"\n[poses]\nkind = "csv"\npath = "../poses.csv"\n'


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project: here is the working directory, there/build.toml names there/scans and poses.csv."""
    project = tmp_path / "project"
    for folder in ("here", "there/scans", "here/scans", "dataset"):
        (project / folder).mkdir(parents=True)
    (project / "there" / "build.toml").write_text(RELATIVE)
    for folder in (project, project / "here"):
        (folder / "poses.csv").write_text("yaw,pitch,roll\n1,2,3\n")
    monkeypatch.chdir(project / "here")
    return project


def places(config: BuildConfig) -> tuple[Path, Path]:
    """Heads and table of poses, absolute."""
    return config.located(config.heads.source), config.located(config.poses.path or "nothing")


def test_paths_of_a_file_count_from_the_file(tree: Path) -> None:
    there = tree / "there" / "scans", tree / "poses.csv"
    assert places(load_config(tree / "there" / "build.toml", {})) == there
    assert places(load_config(Path("../there/build.toml"), {})) == there


def test_paths_of_flags_count_from_the_working_directory(tree: Path) -> None:
    flags: dict[str, Any] = {"heads": {"source": "scans"}, "poses": {"kind": "csv", "path": "poses.csv"}}
    here = tree / "here" / "scans", tree / "here" / "poses.csv"
    assert places(load_config(None, flags)) == here
    assert places(load_config(tree / "there" / "build.toml", flags)) == here, "also over a file"
    source, poses = places(load_config(tree / "there" / "build.toml", {"heads": {"source": "scans"}}))
    assert (source, poses) == (tree / "here" / "scans", tree / "poses.csv"), "each from its own"


def test_the_working_directory_is_that_of_the_beginning(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = load_config(None, {"heads": {"source": "scans"}})
    monkeypatch.chdir(tree)
    assert config.located(config.heads.source) == tree / "here" / "scans"


def test_absolute_paths_are_what_they_are(tree: Path) -> None:
    scans = tree / "here" / "scans"
    (tree / "there" / "build.toml").write_text(f"[heads]\nsource = '{scans}'\n")
    config = load_config(tree / "there" / "build.toml", {})
    assert config.located(config.heads.source) == scans
    assert config.moved_to(tree / "dataset").heads.source == str(scans)


def test_heads_that_are_made_have_no_place(tree: Path) -> None:
    (tree / "there" / "build.toml").write_text('[heads]\nsource = "parametric"\n')
    for config in (
        load_config(tree / "there" / "build.toml", {}),
        load_config(tree / "there" / "build.toml", {"heads": {"source": "parametric"}}),
        recorded_config({"heads": {"source": "parametric"}}, tree / "dataset"),
    ):
        assert config.makes_heads and config.moved_to(tree / "dataset").heads.source == "parametric"
    assert not load_config(None, {"heads": {"source": "scans"}}).makes_heads


def test_the_folder_that_a_maker_is_told_is_a_path_like_others(tree: Path, tmp_path: Path) -> None:
    (tree / "there" / "build.toml").write_text('[heads]\nsource = "ict:scans"\n')
    config = load_config(tree / "there" / "build.toml", {})
    assert config.makes_heads and copy_of(config) == tree / "there" / "scans"
    flag: dict[str, Any] = {"heads": {"source": "ict:scans"}}
    for here in (load_config(None, flag), load_config(tree / "there" / "build.toml", flag)):
        assert copy_of(here) == tree / "here" / "scans" and set(differences(here, config)) == {"heads.source"}
    assert config.moved_to(tree / "dataset").heads.source == "ict:../there/scans"
    again = read_recorded(record(config, tree / "dataset"))
    assert copy_of(again) == copy_of(config) and not differences(again, config)
    moved = tree.rename(tmp_path / "moved")
    assert copy_of(read_recorded(moved / "dataset" / "config.toml")) == moved / "there" / "scans"


def test_a_maker_of_folders_without_one_has_no_path(tree: Path) -> None:
    for source in ("ict:", "ict", "parametric:adults"):
        config = load_config(None, {"heads": {"source": source}})
        assert config.makes_heads and config.moved_to(tree / "dataset").heads.source == source


def copy_of(config: BuildConfig) -> Path:
    """Where the folder lies that a maker is told."""
    return config.located(split_path(config.heads.source)[1])


def record(config: BuildConfig, root: Path) -> Path:
    """What a build writes into its folder."""
    (root / "config.toml").write_text(config_toml(config.moved_to(root)))
    return root / "config.toml"


def test_a_dataset_that_moves_with_its_heads_finds_them(tree: Path, tmp_path: Path) -> None:
    config = load_config(tree / "there" / "build.toml", {})
    record(config, tree / "dataset")
    assert places(read_recorded(tree / "dataset" / "config.toml")) == places(config)
    moved = tree.rename(tmp_path / "moved")
    again = read_recorded(moved / "dataset" / "config.toml")
    assert places(again) == (moved / "there" / "scans", moved / "poses.csv")
    assert not differences(load_config(moved / "there" / "build.toml", {}), again)


def test_the_file_of_a_dataset_is_a_configuration_like_any_other(tree: Path) -> None:
    config = load_config(tree / "there" / "build.toml", {})
    assert places(load_config(record(config, tree / "dataset"), {})) == places(config)


def test_another_place_is_a_difference(tree: Path) -> None:
    begun = read_recorded(record(load_config(tree / "there" / "build.toml", {}), tree / "dataset"))
    other = load_config(tree / "there" / "build.toml", {"heads": {"source": "scans"}})
    assert set(differences(other, begun)) == {"heads.source"}
    written_otherwise = load_config(None, {"heads": {"source": "../there/scans"}, "poses": {"kind": "csv"}})
    assert "heads.source" not in differences(written_otherwise, begun)


FIRST = {"heads": {"source": "scans"}, "poses": {"kind": "sobol", "count": 9}}
"""As the first release recorded it: nothing of poses.same, and a path that counts from where it was built."""


def test_random_poses_of_the_first_release_were_the_same_for_all(tree: Path) -> None:
    assert recorded_config(FIRST, tree / "dataset").poses.same
    today = {**FIRST, "poses": {**FIRST["poses"], "same": False}}
    assert not recorded_config(today, tree / "dataset").poses.same
    assert recorded_config({}, tree / "dataset").poses.same
    assert not load_config(None, FIRST).poses.same


def test_heads_of_the_first_release_are_where_it_was_built(tree: Path) -> None:
    assert places(recorded_config(FIRST, tree / "dataset"))[0] == tree / "here" / "scans"
    (tree / "dataset" / "scans").mkdir()
    assert places(recorded_config(FIRST, tree / "dataset"))[0] == tree / "dataset" / "scans", "as today"


def test_heads_that_are_nowhere_would_lie_beside_the_dataset(
    tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tree)
    assert places(recorded_config(FIRST, tree / "dataset"))[0] == tree / "dataset" / "scans"


@pytest.mark.parametrize(
    "text", ["poses = 3\n", "heads = 'x'\n", "[poses]\nsame = 'maybe'\n", "[rendr]\n", "[poses"]
)
def test_a_recorded_configuration_that_was_changed_is_one_line(tree: Path, text: str) -> None:
    file = tree / "dataset" / "config.toml"
    file.write_text(text)
    with pytest.raises(UsageError) as error:
        read_recorded(file)
    assert str(tree / "dataset") in str(error.value)

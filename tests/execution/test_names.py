# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of heads: what the list accepts, a build accepts; others are skipped before a pixel is rendered."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from dry_build import DRAWN, DryBuild
from hypothesis import given
from hypothesis import strategies as st
from no_renderer import MESH, NoRenderer
from small_builds import config_for, run
from typer.testing import CliRunner

from generator.cli.app import app
from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.execution.replay import replay_sample
from generator.heads.source import find_heads

FINE = (
    *(
        "head (1)",
        "+x",
        "$(x)",
        "`id`",
        "a'b&c",
        "a=b",
        "a, b",
        "50% #1",
        "[x] {y}",
        "-rf",
        "~",
        "!",
        "@",
        "^;",
    ),
    *("ünï", "头部", "ヘッド", "ß", "x\u0301"),
)
REFUSED = (
    "<i>",
    "a|b",
    "a:b",
    'a"b',
    "a*",
    "what?",
    "a\\b",
    "a..b",
    "a.",
    " a",
    "a\tb",
    "a\nb",
    "\u200b",
    "nul.x",
)


@pytest.fixture(autouse=True, scope="module")
def _no_map() -> Iterator[None]:
    """The map takes most of the time of a build that renders nothing."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("generator.execution.build.run.detection_map", lambda root, manifest, file: file)
        yield


def add(built: DryBuild, subject: str, *expressions: str) -> None:
    """A head in a folder of that name."""
    folder = built.heads / subject
    folder.mkdir(parents=True)
    for expression in expressions or ("neutral",):
        (folder / f"{expression}.obj").write_text(MESH)


@pytest.mark.parametrize("poses", [{}, DRAWN], ids=["grid", "drawn"])
def test_what_is_listed_is_built(tmp_path: Path, poses: dict) -> None:
    built = DryBuild(tmp_path)
    for name in (*FINE, *REFUSED):
        add(built, name)
    listed = find_heads(built.heads)
    assert {head.subject for head in listed.heads} == set(FINE)
    assert len(listed.skipped) == len(REFUSED)
    result = built.build(poses=poses)
    assert set(pq.read_table(built.root / "heads.parquet", partitioning=None)["subject"].to_pylist()) == set(
        FINE
    )
    assert len(result.skipped) == len(read_manifest(built.root).skipped) == len(REFUSED)
    built.check()
    assert not built.build(poses=poses, lanes=NoRenderer()).failed_units
    assert built.rendered == [], "it goes on from where it was"


def test_expressions_have_the_same_rule(tmp_path: Path) -> None:
    built = DryBuild(tmp_path)
    add(built, "a", *FINE, *(name for name in REFUSED if "/" not in name))
    result = built.build()
    assert set(pq.read_table(built.root / "data")["expression"].to_pylist()) == set(FINE)
    assert len(result.skipped) == len(REFUSED)
    built.check()


@given(
    names=st.sets(st.text(st.characters(codec="utf-8", exclude_characters="/\0"), min_size=1, max_size=12))
)
def test_any_name_at_all(names: set[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        built = DryBuild(Path(folder))
        add(built, "fine")
        for name in names - {".", "..", "fine"}:
            if len(os.fsencode(name)) < 250 and not name.startswith("."):
                add(built, name)
        listed = find_heads(built.heads)
        built.build()
        assert {head.subject for head in listed.heads} == {
            name.split("/")[0] for name in (row["sample_id"] for row in built.rows)
        }
        built.check()


@pytest.mark.parametrize(
    ("one", "other"), [("Anna", "anna"), ("é", "e\u0301"), ("STRASSE", "straße"), ("Ⅷ", "VIII")]
)
def test_names_that_some_systems_do_not_tell_apart(tmp_path: Path, one: str, other: str) -> None:
    """A dataset of both could not be copied to such a system."""
    built = DryBuild(tmp_path, "b")
    for name in (one, other):
        add(built, name)
    add(built, "c", one, other)
    [subject, expression] = sorted(built.build().skipped, key=lambda head: head.subject == "c")
    assert subject.subject in (one, other) and expression.expression in (one, other)
    for skipped in (subject, expression):
        assert "are one file name on some systems; rename one" in skipped.reason
    built.check()


@pytest.mark.skipif(os.name != "posix", reason="elsewhere names are text")
def test_files_whose_names_are_no_text_are_skipped(tmp_path: Path) -> None:
    built = DryBuild(tmp_path, "b")
    for folder in (b"a", b"c\xff"):
        os.mkdir(os.fsencode(built.heads) + b"/" + folder)
        with open(os.fsencode(built.heads) + b"/" + folder + b"/neut\xffral.obj", "w") as file:
            file.write(MESH)
    skipped = {head.subject: head.reason for head in built.build().skipped}
    assert len(skipped) == 2 and "'neut\\udcffral.obj' holds bytes that are no text" in skipped["a"]
    built.check()


def test_the_list_shows_them_as_they_are(tmp_path: Path) -> None:
    built = DryBuild(tmp_path)
    for name in ("[x] {y}", "[bold]"):
        add(built, name)
    said = CliRunner().invoke(app, ["heads", "list", str(built.heads), "--shallow"]).output
    assert "[x] {y}" in said and "[bold]" in said


@pytest.mark.slow
def test_a_real_build(parametric_heads: Path, tmp_path: Path) -> None:
    """Through lanes, render workers, textures and pictures."""
    names = ("head (1)", "$(x) `id`", "[x] {y}")
    for name in names:
        shutil.copytree(parametric_heads / "s1p0000", tmp_path / "heads & more" / name)
        (tmp_path / "heads & more" / name / "head.json").unlink()
    config = config_for(tmp_path / "heads & more", poses={"roll": [0, 10, 10], "pitch": [0, 10, 10]})
    result = run(config, tmp_path / "data set (1)")
    assert result.complete and result.manifest.heads == 3 and result.pictures[0].is_file()
    report = verify_dataset(result.root)
    assert report.ok, report.text()
    assert {path.name for path in (result.root / "images").iterdir()} == set(names)
    assert replay_sample(result.root, f"{names[0]}/neutral/y+0_p+0_r+0").same

# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset from a stranger, through every command that opens one: nothing gets out, nothing gets in."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer
from changes import LINKS, NAMES, PATHS, SECRET, Change
from small_dataset import build_dataset

from generator import cli
from generator.cli.app import make_app
from generator.registries import FORMATS

pytestmark = pytest.mark.slow

SAMPLE = "s1/neutral/y+0_p+0_r+0"


@dataclass(frozen=True)
class Door:
    """A command on a dataset. reads: what of the changes it comes across and has to refuse."""

    arguments: Callable[[Path, Path], list[str]]
    reads: frozenset[str]


ROWS = frozenset({"names", "sample_id", "image_path", "passes_path", "links", "anchors"})
DOORS: dict[str, Door] = {
    "verify": Door(lambda root, out: ["verify", str(root)], ROWS),
    "report": Door(lambda root, out: ["report", str(root)], frozenset({"names", "image_path", "links"})),
    "ablate": Door(lambda root, out: ["ablate", str(root), "--out", str(out)], frozenset({"sample_id"})),
    "compact": Door(lambda root, out: ["compact", str(root), "--out", str(out)], ROWS),
    "upgrade": Door(lambda root, out: ["upgrade", str(root), "--out", str(out)], frozenset()),
    "replay": Door(lambda root, out: ["replay", str(root), SAMPLE], frozenset()),
    **{
        f"export {name}": Door(
            lambda root, out, name=name: [  # type: ignore[misc]
                *("export", str(root), "--format", name, "--out", str(out)),
                *(["--missing", "skip"] if "skip" in FORMATS.get(name).missing else []),
            ],
            frozenset({"names", "links", "anchors", *(["image_path"] if FORMATS.get(name).images else [])}),
        )
        for name in FORMATS
    },
}
"""Every command that opens a dataset."""

NO_DATASET = {"build", "preview", "doctor", "environment", "preview-server", "heads make", "heads list"}
"""Those that open none. build opens its own folder: tests/execution/test_state_files.py."""


def test_every_command_is_a_door_or_opens_no_dataset() -> None:
    """A new command fails here until somebody has said what it does with a stranger's dataset."""

    def names(group: Any, before: str = "") -> set[str]:
        found = set()
        for name, command in group.commands.items():
            inner = hasattr(command, "commands")
            found |= names(command, f"{before}{name} ") if inner else {before + name}
        return found

    app = typer.main.get_command(make_app())
    assert {door.split()[0] for door in DOORS} | NO_DATASET == names(app)


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound dataset."""
    root = tmp_path_factory.mktemp("template") / "dataset"
    build_dataset(root, twins=("jpeg",))
    return root


@pytest.fixture
def folder(tmp_path: Path, template: Path) -> Path:
    """Of the dataset and of what is outside of it."""
    shutil.copytree(template, tmp_path / "dataset")
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret.txt").write_text(SECRET)
    return tmp_path


CASES = [
    *(("sample_id" if name.startswith("sample_id") else "names", name, c) for name, c in NAMES.items()),
    *((name.split(":")[0], name, change) for name, change in PATHS.items()),
    *(("anchors" if "anchors" in name else "links", name, change) for name, change in LINKS.items()),
]


EXPORTS_A_CASE = int(os.environ.get("HEADTURN_EXPORTS", "4"))
"""Formats that read a change, by turns: all read with the same code. In `make soak` all of them do."""


def doors_of(place: int) -> list[str]:
    """Every command, and of the exports those whose turn it is."""
    exports = [f"export {name}" for name in FORMATS]
    turns = {exports[(EXPORTS_A_CASE * place + k) % len(exports)] for k in range(EXPORTS_A_CASE)}
    return [door for door in DOORS if door not in exports or door in turns]


def test_each_format_reads_changes_of_each_kind() -> None:
    read: dict[str, set[str]] = {}
    for place, (kind, _, _) in enumerate(CASES):
        for door in doors_of(place):
            read.setdefault(door, set()).add(kind)
    assert read.keys() == DOORS.keys()
    assert all(len(kinds) >= 4 for kinds in read.values()), read


@pytest.mark.parametrize(
    ("kind", "change", "door"),
    [
        pytest.param(kind, change, door, id=f"{kind}, {name}-{door}")
        for place, (kind, name, change) in enumerate(CASES)
        for door in doors_of(place)
    ],
)
def test_nothing_gets_out_or_in(
    folder: Path,
    door: str,
    kind: str,
    change: Change,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    root, outside, out = folder / "dataset", folder / "outside", folder / "work" / "out"
    out.parent.mkdir()
    change(root, outside)
    before = contents(folder)
    monkeypatch.chdir(out.parent)
    code = headturn(DOORS[door].arguments(root, out), monkeypatch)
    said = capsys.readouterr()
    text = said.out + said.err
    assert "Traceback" not in text
    assert SECRET not in text
    assert "\x1b[2J" not in text
    assert code in ((1, 2) if kind in DOORS[door].reads else (0, 1, 2)), text
    if code:
        assert not out.exists(), "nothing half-written"
    allowed = (out, root / "report.html")
    for path, content in contents(folder).items():
        if not any(path == a or a in path.parents for a in allowed):
            assert before.get(path) == content, f"{path} was written"
        assert path.is_relative_to(outside) or SECRET.encode() not in content, f"{path} tells the secret"


def headturn(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """The exit code of a command in this process."""
    monkeypatch.setattr(sys, "argv", ["headturn", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0)


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file that lies in a folder."""
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and not p.is_symlink()}


@pytest.mark.parametrize("door", DOORS)
def test_a_sound_dataset_passes(
    folder: Path, door: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Or what the others are refused for would not be what is wrong with them."""
    if door == "replay":
        pytest.skip("nothing can be rendered again of a dataset that was drawn")
    out = folder / "work" / "out"
    out.parent.mkdir()
    code = headturn(DOORS[door].arguments(folder / "dataset", out), monkeypatch)
    assert code == 0, capsys.readouterr()

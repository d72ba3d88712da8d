# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of bash and Python that need nothing of the reader's run, in one folder with one small dataset."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pages
import pytest
from PIL import Image

from downstream_hpe.cli.app import app as downstream_hpe
from generator.cli.app import make_app

pytestmark = pytest.mark.slow

ELSEWHERE = {
    "CONTRIBUTING.md": "make test is this test",
    "docs/blender.md": "tests/addon",
    "docs/headless.md": "tests/addon/test_headless.py",
    "downstream_hpe/models/headturn.md": "tests/downstream_hpe/test_shipped_model.py",
}
"""Pages whose blocks other tests run."""

PROGRAMS = {"headturn": make_app(), "downstream-hpe": downstream_hpe}
RUN = [block for block in pages.blocks("bash", "python") if not block.needs and block.page not in ELSEWHERE]
FIRST = next(block for block in RUN if block.page == "docs/index.md" and block.language == "bash")
"""What the page for beginners says; the other pages show its dataset."""


def run_lines(block: pages.Block, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command of a block, in this process."""
    for line in pages.lines_of(block.text):
        program, *words = shlex.split(line, comments=True)
        monkeypatch.setattr(sys, "argv", [program, *words])
        PROGRAMS[program](words, standalone_mode=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The current folder, with the first dataset by the names that pages have for one, and a photograph."""
    folder = tmp_path_factory.mktemp("reader")
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        run_lines(FIRST, patched)
        for name in ("demo", "dataset"):
            (folder / name).symlink_to("first")
        (folder / "photos").mkdir()
        [front] = (folder / "first" / "images" / "s0p0000").rglob("y+0_p+0_r+0.png")
        for name in ("photo.jpg", "photos/a.jpg"):
            Image.open(front).resize((512, 512)).save(folder / name)
        yield folder


@pytest.fixture(scope="module")
def names() -> dict[str, dict[str, object]]:
    """By page, what its blocks of Python have defined so far."""
    return {}


def test_the_first_dataset(folder: Path) -> None:
    assert "headturn build" in FIRST.text
    for name in ("contact_sheet.png", "report.html", "manifest.json"):
        assert (folder / "first" / name).is_file()


@pytest.mark.parametrize("block", [b for b in RUN if b != FIRST], ids=lambda block: block.place)
def test_a_block_runs(block: pages.Block, folder: Path, names, monkeypatch: pytest.MonkeyPatch) -> None:
    if block.language == "bash":
        run_lines(block, monkeypatch)
    else:
        exec(compile(block.text, block.place, "exec"), names.setdefault(block.page, {}))


def test_every_door_of_the_readme_runs_or_says_what_it_needs() -> None:
    blocks = [block for block in pages.blocks("bash", "python") if block.page == "README.md"]
    assert sum(not block.needs for block in blocks) >= 2
    assert all(block.needs for block in blocks if block.text.startswith(("make ", "pip ", "python3.11 ")))

# SPDX-License-Identifier: GPL-3.0-or-later
"""One bit of any file changes, in a finished dataset and in an unfinished build.

Afterwards the digest is the same, or a command says what is wrong. There is nothing in between.
"""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest
from dry_build import DryBuild
from no_renderer import NoRenderer
from test_state_files import Levelled

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import HeadturnError
from generator.execution.build.folder import LOG_FILE
from generator.messages import BuildOrder, LaneOrder

pytestmark = pytest.mark.slow

FLIPS = int(os.environ.get("HEADTURN_FLIPS", "24"))
"""Of each test; `make soak` asks for 200."""

SEED = int(os.environ.get("HEADTURN_SEED", "0"))
SECTIONS = {"poses": {"frame": "canonical"}, "dataset": {"images": "files", "unit_size": 4}}


class Interrupted(Exception):
    """Stands for whatever ends a build in the middle."""


class UntilTheThird(Levelled):
    """Lanes that go away when the third unit is to be built."""

    def before(self, order: LaneOrder) -> None:
        """See :class:`NoRenderer`."""
        if isinstance(order, BuildOrder) and len(self.built) == 2:
            raise Interrupted


@pytest.fixture
def whole(dry: DryBuild) -> DryBuild:
    """A finished dataset."""
    dry.build(lanes=Levelled(), **SECTIONS)
    return dry


def flipped(root: Path, rng: random.Random) -> Path:
    """One bit of one file, each file as likely as the others; returns which."""
    file = rng.choice(sorted(p for p in root.rglob("*") if p.is_file() and p.stat().st_size))
    content = bytearray(file.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    file.write_bytes(content)
    return file.relative_to(root)


def goes_on(dry: DryBuild, digest: str, what: str) -> str:
    """Build again: the same dataset comes out, or one line. Returns which."""
    try:
        dry.build(lanes=Levelled(), confirm=lambda what: True, **SECTIONS)
    except HeadturnError as error:
        assert str(error) and "\n" not in str(error), what
        return "refused"
    assert dry.digest == digest, what
    report = verify_dataset(dry.root)
    assert report.ok, f"{what}\n{report.text()}"
    return "the same again"


def test_of_a_finished_dataset(whole: DryBuild, capsys: pytest.CaptureFixture) -> None:
    digest, rng = whole.digest, random.Random(SEED)
    template = whole.root.with_name("template")
    whole.root.rename(template)
    ends: dict[str, int] = {}
    for _ in range(FLIPS):
        shutil.rmtree(whole.root, ignore_errors=True)
        shutil.copytree(template, whole.root)
        what = str(flipped(whole.root, rng))
        report = verify_dataset(whole.root)
        if report.ok:
            assert read_manifest(whole.root).digest == digest, what
        end = f"verify {'sees nothing, digest the same' if report.ok else 'says it'}"
        end += f"; build: {goes_on(whole, digest, what)}"
        ends[end] = ends.get(end, 0) + 1
    with capsys.disabled():
        print(f"\nfinished, {FLIPS} flips: {ends}")


@pytest.mark.parametrize("receipts", [True, False], ids=["with receipts", "without"])
def test_of_an_unfinished_build(dry: DryBuild, receipts: bool, capsys: pytest.CaptureFixture) -> None:
    rng = random.Random(SEED)
    with pytest.raises(Interrupted):
        dry.build(lanes=UntilTheThird(), **SECTIONS)
    template = dry.root.with_name("template")
    dry.root.rename(template)
    shutil.copytree(template, dry.root)
    dry.build(lanes=Levelled(), **SECTIONS)
    digest = dry.digest
    ends: dict[str, int] = {}
    for _ in range(FLIPS):
        shutil.rmtree(dry.root)
        shutil.copytree(template, dry.root)
        if not receipts:
            (dry.root / "receipts.jsonl").unlink()
        (dry.root / LOG_FILE).unlink()  # of which every line is as good as the next
        end = goes_on(dry, digest, str(flipped(dry.root, rng)))
        ends[end] = ends.get(end, 0) + 1
    with capsys.disabled():
        print(f"\nunfinished, {FLIPS} flips: {ends}")


def test_the_lanes_of_these_tests_are_interrupted(dry: DryBuild) -> None:
    """Or nothing above is about unfinished builds."""
    with pytest.raises(Interrupted):
        dry.build(lanes=UntilTheThird(), **SECTIONS)
    assert len(dry.parts) == 2 and issubclass(UntilTheThird, NoRenderer)

# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders for images in flight: on a tmpfs where it has room, and never left behind."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections import namedtuple
from pathlib import Path

import pytest

from generator.execution.lanes import scratch
from generator.execution.lanes.scratch import ENOUGH, remove_leftovers, scratch_folder

Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """What stands for /dev/shm, with room enough, and what for the temporary folder."""
    memory, disk = tmp_path / "shm", tmp_path / "tmp"
    memory.mkdir()
    disk.mkdir()
    monkeypatch.setattr(scratch, "_TMPFS", memory)
    monkeypatch.setattr(tempfile, "tempdir", str(disk))
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(2 * ENOUGH, 0, ENOUGH))
    return memory, disk


@pytest.fixture
def dead() -> int:
    """The id of a process that has ended."""
    done = subprocess.Popen([sys.executable, "-S", "-c", ""])
    done.wait()
    return done.pid


def test_it_lies_on_the_tmpfs_and_is_gone_afterwards(places: tuple[Path, Path]) -> None:
    memory, disk = places
    with scratch_folder() as folder, scratch_folder() as other:
        assert folder.parent == other.parent == memory and folder != other
        (folder / "lane0").mkdir()
        (folder / "lane0" / "frame.bmp").write_bytes(b"x")
    assert not any(memory.iterdir()) and not any(disk.iterdir())


def test_it_is_gone_after_an_error(places: tuple[Path, Path]) -> None:
    with pytest.raises(KeyboardInterrupt), scratch_folder() as folder:
        raise KeyboardInterrupt
    assert not folder.exists()


def test_a_tmpfs_that_is_small_or_missing_is_not_used(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    memory, disk = places
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(ENOUGH, 1, ENOUGH - 1))
    with scratch_folder() as folder:
        assert folder.parent == disk
    monkeypatch.setattr(scratch, "_TMPFS", memory / "missing")
    with scratch_folder() as folder:
        assert folder.parent == disk


def test_what_dead_processes_left_is_removed_and_nothing_else(places: tuple[Path, Path], dead: int) -> None:
    memory, _ = places
    names = [
        f"headturn-{dead}-abc",
        f"headturn-{os.getpid()}-abc",
        "headturn-1-abc",
        "headturn-x-abc",
        "other",
    ]
    for name in names:
        (memory / name).mkdir()
        (memory / name / "frame.bmp").write_bytes(b"x")
    remove_leftovers()
    assert sorted(path.name for path in memory.iterdir()) == sorted(names[1:])
    (memory / names[0]).mkdir()
    with scratch_folder():
        assert not (memory / names[0]).exists(), "whoever comes next removes it"

# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders for images in flight: on a tmpfs where it has room, and never left behind."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import namedtuple
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from generator.execution.lanes import scratch
from generator.execution.lanes.scratch import ENOUGH, remove_leftovers, scratch_folder
from generator.locks import NoLocks

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


HOLD = """
import sys, tempfile
from pathlib import Path
from generator.execution.lanes import scratch
scratch._TMPFS = Path(sys.argv[1])
scratch.ENOUGH = 0
with scratch.scratch_folder() as folder:
    (folder / "frame.bmp").write_bytes(b"x")
    print(folder, flush=True)
    sys.stdin.read()
"""


@contextmanager
def holder(base: Path, *around: str) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """Another process with a scratch folder in base, and that folder. around: what starts the process."""
    command = [*around, sys.executable, "-c", HOLD, str(base)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        yield process, Path(process.stdout.readline().strip())
        process.kill()


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


def test_what_dead_processes_left_is_removed_and_nothing_else(places: tuple[Path, Path]) -> None:
    memory, _ = places
    others = ["headturn-1-abc", f"headturn-{os.getpid()}-abc", "headturn-x-abc", "other"]
    for name in others:  # no lock says whether they are in use
        (memory / name).mkdir()
        (memory / name / "frame.bmp").write_bytes(b"x")
    with holder(memory) as (process, folder):
        remove_leftovers()
        assert (folder / "frame.bmp").exists()
        process.kill()
        process.wait()
        assert folder.exists()
        with scratch_folder():
            assert not folder.exists(), "whoever comes next removes it"
    assert sorted(path.name for path in memory.iterdir()) == sorted(others)


def test_containers_that_share_a_tmpfs_leave_each_others_folders(places: tuple[Path, Path]) -> None:
    """Their processes have the same ids, or none that the other one knows."""
    memory, _ = places
    unshare = ["unshare", "--pid", "--fork", "--kill-child"]
    if shutil.which("unshare") is None or subprocess.run([*unshare, "true"], capture_output=True).returncode:
        pytest.skip("no PID namespaces here")
    with holder(memory, *unshare) as (process, folder), holder(memory, *unshare) as (_, other):
        remove_leftovers()
        assert folder != other and (folder / "frame.bmp").exists() and (other / "frame.bmp").exists()
        process.kill()
        process.wait()
        deadline = time.monotonic() + 10
        while folder.exists() and time.monotonic() < deadline:  # the namespace ends a moment later
            remove_leftovers()
        assert not folder.exists() and other.exists()


def test_a_tmpfs_without_locks_is_used_and_nothing_there_is_removed(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(file: object) -> bool:
        raise NoLocks(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(scratch, "try_lock", no_locks)
    with scratch_folder() as folder, scratch_folder() as other:
        remove_leftovers()
        assert folder.exists() and other.exists()
    assert not any(places[0].iterdir())


def test_links_are_not_followed(places: tuple[Path, Path], tmp_path: Path) -> None:
    memory, _ = places
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / ".in-use").touch()
    (memory / "headturn-1-abc").symlink_to(mine)
    remove_leftovers()
    assert mine.exists()

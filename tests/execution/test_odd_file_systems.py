# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders that are moved under a build, and file systems without locks or without fsync."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from dry_build import DryBuild
from no_renderer import NoRenderer
from small_builds import host

from generator import locks
from generator.dataset.format.files import append_line, check_there, write_anywhere, write_bytes, write_files
from generator.errors import DatasetError
from generator.execution.build import lock as build_lock
from generator.execution.build.lock import LOCK_FILE, locked
from generator.messages import BuildOrder, LaneOrder, PlaceOrder
from generator.plan.config import BuildConfig

MOVED = "this folder was moved, renamed or deleted while files were written there"


class Moves(NoRenderer):
    """Renames or replaces the dataset's folder when the nth order of a kind comes."""

    def __init__(self, root: Path, kind: type, number: int, then: str) -> None:
        super().__init__()
        self._root, self._kind, self._left, self._then = root, kind, number, then

    def before(self, order: LaneOrder) -> None:
        self._left -= isinstance(order, self._kind)
        if self._left == 0:
            self._left = -1
            if self._then == "deleted":
                shutil.rmtree(self._root)
            else:
                self._root.rename(self._root.with_name("elsewhere"))
            if self._then == "replaced":
                self._root.mkdir()


@pytest.mark.parametrize("kind", [PlaceOrder, BuildOrder])
@pytest.mark.parametrize("then", ["renamed", "deleted", "replaced"])
def test_the_folder_goes_during_a_build(dry: DryBuild, kind: type, then: str) -> None:
    expected = "replaced by another one" if then == "replaced" else MOVED
    with pytest.raises(DatasetError, match=expected):
        dry.build(lanes=Moves(dry.root, kind, 2, then))
    assert not (dry.root / "manifest.json").exists()
    assert dry.root.exists() == (then == "replaced")
    shutil.rmtree(dry.root, ignore_errors=True)
    if then != "deleted":
        (dry.root.with_name("elsewhere")).rename(dry.root)
    dry.build(confirm=lambda what: True)
    dry.check()


@pytest.mark.slow
def test_lanes_do_not_make_it_again(built: tuple[BuildConfig, Path], tmp_path: Path) -> None:
    root = tmp_path / "d"
    with host(built[0], root) as started:
        while not list(root.glob("data/*/part-*")):
            assert started.process.poll() is None, started.text()
            time.sleep(0.02)
        root.rename(tmp_path / "elsewhere")
        code = started.wait()
        if code == 0 or "data" in started.text():  # it was done before it could notice
            pytest.skip("the build was too quick")
        assert code == 1 and MOVED in started.text(), started.text()
        assert "Traceback" not in started.text()
        assert not root.exists()
        assert not started.orphans()


def test_nothing_makes_a_folder_that_is_gone(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    for write in (
        lambda: write_bytes(gone / "poses.csv", b"x"),
        lambda: write_files({gone / "images" / "a" / "b.png": b"x"}, gone),
        lambda: check_there(gone),
    ):
        with pytest.raises(DatasetError, match=MOVED):
            write()
    with pytest.raises(DatasetError, match="No such file"):
        append_line(gone / "receipts.jsonl", "x")
    assert not gone.exists()
    write_anywhere(gone / "a" / "report.html", b"x")
    assert (gone / "a" / "report.html").read_bytes() == b"x"


@pytest.mark.skipif(sys.platform == "win32", reason="other locks there")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL])
def test_without_locks_a_file_takes_their_place(
    dry: DryBuild, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def no_locks(file: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(locks, "_lock", no_locks)
    dry.build()
    dry.check()
    assert any("no locks there" in note and os.strerror(number) in note for note in dry.said.notes)
    with locked(dry.root), pytest.raises(DatasetError, match=r"another build \(process \d+ on .*is at work"):
        dry.build()
    done = subprocess.Popen([sys.executable, "-S", "-c", ""])
    done.wait()
    mine = build_lock.socket.gethostname()
    (dry.root / LOCK_FILE).write_text(f'{{"pid": {done.pid}, "host": "{mine}"}}')
    dry.build()  # that process has ended
    for holder in ('{"pid": 1, "host": "elsewhere"}', "{not json", "[]", '{"pid": "1"}'):
        (dry.root / LOCK_FILE).write_text(holder)
        with pytest.raises(DatasetError, match=f"if it does not, delete {dry.root / LOCK_FILE}"):
            dry.build()
        (dry.root / LOCK_FILE).unlink()


@pytest.mark.skipif(os.name != "posix", reason="no folders are synced there")
@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP, errno.ENOSYS])
@pytest.mark.parametrize("of", ["folders", "everything"])
def test_without_fsync_a_build_goes_on_and_says_so(
    dry: DryBuild, monkeypatch: pytest.MonkeyPatch, number: int, of: str
) -> None:
    def fsync(handle: int) -> None:
        if of == "everything" or os.path.isdir(f"/proc/self/fd/{handle}"):
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fsync)
    dry.build()
    dry.check()
    [note] = [note for note in dry.said.notes if "a power cut may cost the newest files" in note]
    assert os.strerror(number) in note


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC])
def test_a_disk_that_fails_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def fsync(handle: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(DatasetError, match=os.strerror(number)):
        write_bytes(tmp_path / "a", b"x")
    assert not list(tmp_path.iterdir())

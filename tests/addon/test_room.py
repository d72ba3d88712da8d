# SPDX-License-Identifier: GPL-3.0-or-later
"""What lasts stays within its limit, and one process at a time makes heads in a folder."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from blender_addon.core.room import make_room, use
from generator.locks import alone


def folder(path: Path, kilobytes: int, age_s: float) -> Path:
    (path / "deep").mkdir(parents=True)
    (path / "deep" / "head.npz").write_bytes(bytes(kilobytes * 1000))
    then = time.time() - age_s
    os.utime(path, (then, then))
    return path


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path) -> None:
    made, heads = tmp_path / "made", tmp_path / "heads"
    oldest, used = folder(made / "a", 50, 300), folder(made / "b", 50, 900)
    newest, middle = folder(heads / "c", 50, 10), folder(heads / "d", 50, 200)
    make_room([made, heads], 200_000)
    assert all(path.is_dir() for path in (oldest, used, newest, middle)), "there is room"
    use(used)
    make_room([made, heads], 110_000)
    assert used.is_dir() and newest.is_dir() and not oldest.exists() and not middle.exists()


HOLDS = """
import sys
from pathlib import Path
from generator.locks import alone
with alone(Path(sys.argv[1])):
    print("in", flush=True)
    input()
"""


def test_one_process_at_a_time(tmp_path: Path) -> None:
    lock = tmp_path / "made.lock"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    other = subprocess.Popen([sys.executable, "-c", HOLDS, str(lock)], **pipes)
    assert other.stdout.readline() == "in\n"
    third = subprocess.Popen([sys.executable, "-c", HOLDS, str(lock)], **pipes)
    time.sleep(0.3)
    assert third.poll() is None
    other.communicate("\n")
    assert third.stdout.readline() == "in\n"
    third.communicate("\n")
    with alone(lock):
        pass

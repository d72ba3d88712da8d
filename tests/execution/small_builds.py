# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds as small as they can be, with a real Blender and a real detector."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import psutil
from quiet import Quiet

from generator.execution.build.run import BuildResult, build
from generator.execution.executors.executor import Executor
from generator.execution.executors.open import open_executor
from generator.execution.lanes.scratch import remove_leftovers
from generator.plan.config import BuildConfig, config_toml, load_config

ROOT = Path(__file__).resolve().parents[2]

SMALL = {
    "poses": {"yaw": [-40, 40, 40], "pitch": [0, 0, 10], "roll": [0, 20, 20]},
    "render": {"resolution": 96},
    "dataset": {"unit_size": 4},
}


def config_for(source: Path | str, **sections: dict) -> BuildConfig:
    merged = {name: {**SMALL.get(name, {}), **sections.get(name, {})} for name in {*SMALL, *sections}}
    merged["heads"] = {"source": str(source), **merged.get("heads", {})}
    return load_config(None, merged)


def run(
    config: BuildConfig,
    root: Path,
    executor: str = "local",
    reporter: Quiet | None = None,
    *,
    lanes: dict[str, Any] | None = None,
    **options: Any,
) -> BuildResult:
    """Build in this process. lanes: further arguments of open_executor; options: of build.

    The plain local executor is opened once for all tests: its lanes take seconds to start.
    """
    if executor == "local" and not lanes:
        return build(config, root, _local(), reporter or Quiet(), **options)
    with open_executor(executor, **(lanes or {})) as opened:
        return build(config, root, opened, reporter or Quiet(), **options)


_open = ExitStack()


@cache
def _local() -> Executor:
    return _open.enter_context(open_executor("local"))


def close_lanes() -> None:
    """End the lanes that :func:`run` keeps."""
    _open.close()
    _local.cache_clear()


class Host:
    """``headturn build`` in a process of its own, and whatever it starts."""

    def __init__(self, config: BuildConfig, root: Path, *options: str) -> None:
        self.root = root
        file = root.parent / f"{root.name}.toml"
        file.write_text(config_toml(config))
        self._mark = uuid.uuid4().hex  # inherited by every process the build starts, however deep
        self.output = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed by host()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "generator.cli", "build", str(file), "--out", str(root), *options],
            env={**os.environ, "HEADTURN_TEST": self._mark, "PYTHONPATH": str(ROOT)},
            stdout=self.output,
            stderr=subprocess.STDOUT,
        )

    def wait(self, timeout: float = 120) -> int:
        """The exit code."""
        return self.process.wait(timeout)

    def text(self) -> str:
        """What it printed."""
        self.output.seek(0)
        return self.output.read()

    def workers(self, module: str = "") -> list[psutil.Process]:
        """Every process the build started that is alive, or those that run a module."""
        found = []
        for process in psutil.process_iter():
            try:
                if (
                    process.pid != self.process.pid
                    and process.environ().get("HEADTURN_TEST") == self._mark
                    and process.status() != psutil.STATUS_ZOMBIE
                    and module in " ".join(process.cmdline())
                ):
                    found.append(process)
            except psutil.Error:
                continue  # it ended while we looked, or is not ours
        return found

    def orphans(self, patience: float = 3.0) -> list[str]:
        """Command lines of workers that are still there some time after the host's end."""
        deadline = time.monotonic() + patience
        while (left := self.workers()) and time.monotonic() < deadline:
            time.sleep(0.05)
        return [" ".join(process.cmdline()) for process in left]


@contextmanager
def host(config: BuildConfig, root: Path, *options: str) -> Iterator[Host]:
    """A build that is killed at the end if it still runs."""
    started = Host(config, root, *options)
    try:
        yield started
    finally:
        started.process.kill()
        started.process.wait()
        started.output.close()
        remove_leftovers()

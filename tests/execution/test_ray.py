# SPDX-License-Identifier: GPL-3.0-or-later
"""The same dataset from Ray's actors, also when one is killed."""

from __future__ import annotations

import os
import shutil
import signal
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest
from small_builds import Quiet

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError
from generator.execution.build.folder import CONFIG_FILE
from generator.execution.build.placed_heads import PLACED_FILE
from generator.execution.build.run import build
from generator.execution.executors.open import open_executor
from generator.plan.config import BuildConfig

# Not imported here: whether it listens beyond this machine is decided when it is.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
"""Ray's own, which are not ours to fix."""


def actors() -> list[psutil.Process]:
    return [p for p in psutil.Process().children(recursive=True) if p.name().startswith("ray::LaneActor")]


def test_ray_builds_the_same_dataset_and_survives_a_killed_actor(
    built: tuple[BuildConfig, Path], tmp_path: Path
) -> None:
    root = tmp_path / "d"
    root.mkdir()
    for name in (CONFIG_FILE, PLACED_FILE):
        shutil.copy(built[1] / name, root)
    reporter = Quiet()
    killed: list[int] = []
    others = set(psutil.Process().children(recursive=True))
    with open_executor("ray", workers=2) as lanes:

        def kill_one(kind: str, facts: dict) -> None:
            if not killed:
                killed.append(actors()[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        reporter.event = kill_one  # type: ignore[method-assign]
        listening = [c for p in [psutil.Process(), *psutil.Process().children(True)] for c in heard_by(p)]
        result = build(built[0], root, lanes, reporter)
        started = set(psutil.Process().children(recursive=True)) - others
    assert started
    assert killed
    assert listening
    assert {address.removeprefix("::ffff:") for address in listening} == {"127.0.0.1"}
    assert result.complete
    assert result.manifest.digest == read_manifest(built[1]).digest
    assert verify_dataset(root).ok
    _, alive = psutil.wait_procs(list(started), timeout=10)
    assert not alive


def heard_by(process: psutil.Process) -> list[str]:
    """Addresses a process listens on."""
    try:
        return [c.laddr.ip for c in process.net_connections("tcp") if c.status == psutil.CONN_LISTEN]
    except psutil.Error:
        return []


def test_a_cluster_that_is_not_there_is_one_line() -> None:
    with (
        pytest.raises(UsageError, match="no Ray cluster answers"),
        open_executor("ray", address="127.0.0.1:1"),
    ):
        pass


def test_an_address_is_for_ray() -> None:
    with pytest.raises(UsageError, match="--address is for --executor ray"), open_executor(address="auto"):
        pass

# SPDX-License-Identifier: GPL-3.0-or-later
"""Executors by name, what they are made from, and who gets which core."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from generator import registries
from generator.errors import UsageError
from generator.execution.executors import executor as sharing
from generator.execution.executors import open as opening
from generator.execution.executors.executor import Circumstances, share_cores
from generator.execution.executors.open import open_executor
from generator.execution.lanes import renderer
from generator.execution.lanes.options import DEADLINE_S, OnImage
from generator.execution.lanes.slot import Outcome
from generator.messages import LaneOrder


class Dummy:
    """Remembers what it was made from, and whether its folder was there when it was closed."""

    name, workers = "dummy", 1

    def __init__(self, given: Circumstances) -> None:
        self.given, self.closed = given, False

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """Nothing is carried out."""
        return iter(())

    def close(self) -> None:
        """See Executor."""
        assert self.given.scratch.is_dir()
        self.closed = True


@pytest.fixture(autouse=True)
def _dummy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An executor called dummy, and a bpy that need not be there."""
    monkeypatch.setattr(renderer, "find_spec", lambda name: ModuleSpec(name, None))
    registries.EXECUTORS.add("dummy", Dummy)
    yield
    registries.EXECUTORS.remove("dummy")


def test_an_executor_has_a_folder_as_long_as_it_is_open() -> None:
    with open_executor("dummy", workers=3, deadline_s=9.0, memory_mib=100.0) as opened:
        assert isinstance(opened, Dummy)
        given = opened.given
        assert given.scratch.is_dir() and not opened.closed
        assert (given.workers, given.address) == (3, None)
        assert (given.options.deadline_s, given.options.memory_mib) == (9.0, 100.0)
    assert opened.closed and not given.scratch.exists()


def test_it_is_closed_whatever_happens() -> None:
    with pytest.raises(KeyboardInterrupt), open_executor("dummy") as opened:
        raise KeyboardInterrupt
    assert isinstance(opened, Dummy) and opened.closed and not opened.given.scratch.exists()


def test_lanes_share_the_memory_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "_memory_mib", lambda: 1000.0)
    monkeypatch.setattr(opening, "available_cores", lambda: [0, 1, 2, 3])
    for workers, share in ((None, 200.0), (2, 400.0)):
        with open_executor("dummy", workers=workers) as opened:
            assert isinstance(opened, Dummy)
            assert opened.given.options.memory_mib == pytest.approx(share)
            assert opened.given.options.deadline_s == DEADLINE_S


def test_a_name_that_is_unknown_is_one_line() -> None:
    with pytest.raises(UsageError, match="--executor 'cloud': expected one of serial, local, ray, dummy"):
        open_executor("cloud").__enter__()


@pytest.mark.parametrize("name", ["serial", "local", "dummy"])
def test_an_address_is_for_ray(name: str) -> None:
    with pytest.raises(UsageError, match=f"--address is for --executor ray, not {name}"):
        open_executor(name, address="auto").__enter__()


def test_without_bpy_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(renderer, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match="bpy is not installed: pip install"):
        open_executor("dummy").__enter__()


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ("Blender 4.1.9", "Blender 4.1 is too old, Headturn needs 4.2 or newer"),
        ("hello", "does not answer --version as a Blender does"),
        ("", "does not answer --version as a Blender does"),
    ],
)
def test_a_program_that_is_no_blender_of_ours_is_one_line(says: str, reason: str, tmp_path: Path) -> None:
    program = tmp_path / "blender"
    program.write_text(f"#!/bin/sh\necho '{says}'\n")
    with pytest.raises(UsageError, match="not an executable Blender"):
        open_executor("dummy", blender=str(program)).__enter__()
    program.chmod(0o755)
    with pytest.raises(UsageError, match=reason):
        open_executor("dummy", blender=str(program)).__enter__()


def test_a_blender_is_handed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "blender"
    program.write_text("#!/bin/sh\necho 'Blender 5.0.1'\n")
    program.chmod(0o755)
    monkeypatch.setattr(renderer, "find_spec", lambda name: None)  # no bpy is needed then
    with open_executor("dummy", blender=str(program)) as opened:
        assert isinstance(opened, Dummy) and opened.given.options.blender == str(program)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sets(st.integers(0, 300), min_size=1, max_size=32).map(sorted), st.integers(1, 40))
def test_every_worker_has_cores_and_every_core_has_work(
    monkeypatch: pytest.MonkeyPatch, cores: list[int], workers: int
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(sharing, "available_cores", lambda: cores)
        shares = share_cores(workers)
    assert len(shares) == workers
    taken = [core for share in shares for core in share]
    assert set(taken) == set(cores) if workers <= len(cores) else set(taken) <= set(cores)
    assert all(shares)
    if workers <= len(cores):
        assert len(taken) == len(set(taken)), "and none shares one"
        assert max(map(len, shares)) - min(map(len, shares)) <= 1
    else:
        assert max(map(taken.count, taken)) - min(map(taken.count, cores)) <= 1, "in turn"

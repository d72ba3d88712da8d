# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles renders on. These tests need no GPU: the preferences of a machine with some are played."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from generator.errors import UsageError, WorkerError
from generator.execution.build.placed_heads import lane_versions
from generator.execution.executors.open import open_executor
from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.plan.settings import Landmarks

bpy = pytest.importorskip("bpy")

from generator.blender.devices import Device, gpus  # noqa: E402

pytestmark = pytest.mark.slow


class Preferences:
    """Cycles' own, of a machine with these devices: (backend, name)."""

    def __init__(self, *there: tuple[str, str]) -> None:
        self._there = there
        self.compute_device_type = "NONE"
        self.devices: list[Any] = []

    def refresh_devices(self) -> None:
        self.devices = [
            SimpleNamespace(type=backend, name=name, id=f"{backend} {n}", use=backend != "CPU")
            for n, (backend, name) in enumerate(self._there)
        ]

    def get_device_types(self, context: Any) -> list[tuple[str, str, str, int]]:
        return [(name, name, "", n) for n, name in enumerate(("NONE", "CUDA", "OPTIX", "HIP", "ONEAPI"))]

    def get_devices_for_type(self, backend: str) -> list[Any]:
        assert self.devices, "they are empty until they are refreshed"
        return [one for one in self.devices if one.type in (backend, "CPU")]


CPU = ("CPU", "some processor")
TWO = (("CUDA", "A"), ("CUDA", "B"), CPU, ("OPTIX", "A"), ("OPTIX", "B"))


def scene() -> Any:
    return SimpleNamespace(cycles=SimpleNamespace(device="?"))


def test_a_gpu_of_two_backends_is_named_once_by_the_quicker_one() -> None:
    assert [str(gpu) for gpu in gpus(Preferences(*TWO))] == ["A (OPTIX)", "B (OPTIX)"]
    assert [str(gpu) for gpu in gpus(Preferences(CPU, ("HIP", "C")))] == ["C (HIP)"]
    assert gpus(Preferences(CPU, ("METAL", "not of this Blender"))) == []


def test_lanes_take_their_turns_among_gpus_and_use_no_other_device() -> None:
    for lane, name in enumerate(("A", "B", "A")):
        preferences, shown = Preferences(*TWO), scene()
        device = Device(lane, preferences)
        assert str(device) == f"{name} (OPTIX)"
        preferences.compute_device_type, preferences.devices = "NONE", []  # factory settings
        device.use(shown)
        assert shown.cycles.device == "GPU" and preferences.compute_device_type == "OPTIX"
        assert [(one.type, one.name) for one in preferences.devices if one.use] == [("OPTIX", name)]


def test_without_a_gpu_it_is_the_cpu_and_says_so() -> None:
    for device in (Device(), Device(0, Preferences(CPU))):
        shown = scene()
        device.use(shown)
        assert str(device) == "" and shown.cycles.device == "CPU"


class Worker:
    """A render worker that only says on what it renders."""

    opened: ClassVar[list[Worker]] = []

    def __init__(self, *_: Any, gpu: int | None, **__: Any) -> None:
        self.gpu, self.closed = gpu, False
        self.device = "" if gpu is None else self.there
        Worker.opened.append(self)

    there = "A (OPTIX)"

    def close(self) -> None:
        self.closed = True


def test_heads_are_placed_on_the_cpu_whatever_renders(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("generator.execution.lanes.lane.Renderer", Worker)
    monkeypatch.setattr(Worker, "opened", [])
    Lane(LaneOptions(scratch=str(tmp_path), gpu=3))
    assert [worker.gpu for worker in Worker.opened] == [3, None]
    monkeypatch.setattr(Worker, "opened", [])
    Lane(LaneOptions(scratch=str(tmp_path)))
    assert [worker.gpu for worker in Worker.opened] == [None]


def test_a_lane_that_finds_no_gpu_says_so_and_leaves_nothing_running(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("generator.execution.lanes.lane.Renderer", Worker)
    monkeypatch.setattr(Worker, "opened", [])
    monkeypatch.setattr(Worker, "there", "")
    with pytest.raises(WorkerError, match="finds no GPU here"):
        Lane(LaneOptions(scratch=str(tmp_path), gpu=0))
    assert [worker.closed for worker in Worker.opened] == [True]


@pytest.mark.skipif(bool(gpus()), reason="there is a GPU")
def test_a_build_says_in_one_line_that_there_is_none() -> None:
    with pytest.raises(UsageError, match="finds no GPU here"), open_executor(device="gpu"):
        pass
    with (
        pytest.raises(UsageError, match="--device cuda: expected cpu, gpu, auto"),
        open_executor(device="cuda"),
    ):
        pass
    with open_executor("serial", device="auto") as executor:
        assert " on " not in lane_versions(executor, Landmarks())["blender"]

# SPDX-License-Identifier: GPL-3.0-or-later
"""Choose and open an executor by name."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from generator import registries
from generator.cgroup import memory_bytes, worthwhile
from generator.errors import UsageError
from generator.execution.executors.executor import Circumstances, Executor
from generator.execution.lanes.options import CPU, DEADLINE_S, DEVICES, GPU, LaneOptions
from generator.execution.lanes.renderer import Renderer, check_blender, worker_command
from generator.execution.lanes.scratch import scratch_folder
from generator.process import MIB, available_cores

MEMORY_SHARE = 0.8
"""Of the memory of this machine or control group, for all lanes together, where no limit is given."""


@contextmanager
def open_executor(
    name: str = "local",
    *,
    workers: int | None = None,
    blender: str | None = None,
    deadline_s: float = DEADLINE_S,
    memory_mib: float | None = None,
    device: str = CPU,
    address: str | None = None,
) -> Iterator[Executor]:
    """An executor with its scratch folder; both are gone at the end, however it comes.

    name: one of registries.EXECUTORS. workers: lanes, default one a core. deadline_s, memory_mib:
    see :class:`generator.execution.lanes.options.LaneOptions`. device: of DEVICES. address: of a Ray cluster.
    Raises UsageError for an unknown name, if no Blender or wanted GPU can be found, or Ray is not installed.
    """
    make = registries.EXECUTORS.get(name)
    if address is not None and name != "ray":
        raise UsageError(f"--address is for --executor ray, not {name}")
    if device not in DEVICES:
        raise UsageError(f"--device {device}: expected {', '.join(DEVICES)}")
    worker_command(blender, 1)
    if blender is not None:
        check_blender(blender)
        blender = os.path.abspath(blender) if os.path.dirname(blender) else blender
    if memory_mib is None:
        memory_mib = MEMORY_SHARE * _memory_mib() / (workers or worthwhile(available_cores()))
    with scratch_folder() as scratch:
        # The machines of a cluster are others than this one: there each lane says so itself.
        sure = device == CPU or (device == GPU and address is not None)
        on_gpu = device == GPU if sure else _has_gpu(scratch, blender, device)
        gpu = 0 if on_gpu else None
        options = LaneOptions(blender=blender, gpu=gpu, deadline_s=deadline_s, memory_mib=memory_mib)
        executor: Executor = make(Circumstances(scratch, workers, address, options))
        try:
            yield executor
        finally:
            executor.close()


def _has_gpu(scratch: Path, blender: str | None, device: str) -> bool:
    """Is there a GPU? UsageError if there must be one."""
    worker = Renderer(scratch, scratch / "render.log", blender=blender, threads=1, gpu=0)
    worker.close()
    if device == GPU and not worker.device:
        raise UsageError(
            "--device gpu: Blender finds no GPU here that Cycles can render on; is its driver installed? "
            "--device auto takes the CPU then"
        )
    return bool(worker.device)


def _memory_mib() -> float:
    """Memory that there is for a build; 0, for no limit, where nothing says it."""
    there = memory_bytes()
    return 0.0 if math.isinf(there) else there / MIB

# SPDX-License-Identifier: GPL-3.0-or-later
"""Choose and open an executor by name."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager

from generator import registries
from generator.cgroup import memory_bytes, worthwhile
from generator.errors import UsageError
from generator.execution.executors.executor import Circumstances, Executor
from generator.execution.lanes.options import DEADLINE_S, LaneOptions
from generator.execution.lanes.renderer import check_blender, worker_command
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
    address: str | None = None,
) -> Iterator[Executor]:
    """An executor with its scratch folder; both are gone at the end, however it comes.

    name: one of registries.EXECUTORS. workers: lanes, default one a core. deadline_s, memory_mib:
    see :class:`generator.execution.lanes.options.LaneOptions`. address: of a Ray cluster.
    Raises UsageError for an unknown name, if no Blender can be found, or Ray is not installed.
    """
    make = registries.EXECUTORS.get(name)
    if address is not None and name != "ray":
        raise UsageError(f"--address is for --executor ray, not {name}")
    worker_command(blender, 1)
    if blender is not None:
        check_blender(blender)
        blender = os.path.abspath(blender) if os.path.dirname(blender) else blender
    if memory_mib is None:
        memory_mib = MEMORY_SHARE * _memory_mib() / (workers or worthwhile(available_cores()))
    options = LaneOptions(blender=blender, deadline_s=deadline_s, memory_mib=memory_mib)
    with scratch_folder() as scratch:
        executor: Executor = make(Circumstances(scratch, workers, address, options))
        try:
            yield executor
        finally:
            executor.close()


def _memory_mib() -> float:
    """Memory that there is for a build; 0, for no limit, where nothing says it."""
    there = memory_bytes()
    return 0.0 if math.isinf(there) else there / MIB

# SPDX-License-Identifier: GPL-3.0-or-later
"""Choose and open an executor by name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from generator import registries
from generator.errors import UsageError
from generator.execution.executors.executor import Circumstances, Executor
from generator.execution.lanes.options import DEADLINE_S, LaneOptions
from generator.execution.lanes.renderer import check_blender, worker_command
from generator.execution.lanes.scratch import scratch_folder
from generator.process import MIB, available_cores

MEMORY_SHARE = 0.8
"""Of this machine's memory, for all lanes together, where no limit is given."""


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
        memory_mib = MEMORY_SHARE * _memory_mib() / (workers or len(available_cores()))
    options = LaneOptions(blender=blender, deadline_s=deadline_s, memory_mib=memory_mib)
    with scratch_folder() as scratch:
        executor: Executor = make(Circumstances(scratch, workers, address, options))
        try:
            yield executor
        finally:
            executor.close()


def _memory_mib() -> float:
    """Memory of this machine; 0, for no limit, where it is not told."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / MIB
    except (AttributeError, ValueError, OSError):
        return 0.0

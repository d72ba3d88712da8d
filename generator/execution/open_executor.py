# SPDX-License-Identifier: GPL-3.0-or-later
"""Choose and open an executor by name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from generator.errors import UsageError
from generator.execution.executor import Executor, LocalExecutor, SerialExecutor, available_cores
from generator.execution.renderer import worker_command
from generator.execution.scratch import scratch_folder


@contextmanager
def open_executor(
    name: str = "local",
    *,
    workers: int | None = None,
    blender: str | None = None,
    min_confidence: float = 0.5,
) -> Iterator[Executor]:
    """An executor with its scratch folder; both are gone at the end, however it comes.

    name: "serial" or "local". workers: lanes of "local", default one a core.
    Raises UsageError for an unknown name, or if no Blender can be found.
    """
    worker_command(blender, 1)
    with scratch_folder() as scratch:
        executor: Executor
        if name == "serial":
            executor = SerialExecutor(scratch, blender=blender, min_confidence=min_confidence)
        elif name == "local":
            lanes = workers or len(available_cores())
            executor = LocalExecutor(scratch, lanes, blender=blender, min_confidence=min_confidence)
        else:
            raise UsageError(f"executor {name!r}: expected serial or local")
        try:
            yield executor
        finally:
            executor.close()

# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads made by as many processes as pay."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from generator.cgroup import worthwhile
from generator.errors import HeadError, WorkerError
from generator.pool import processes
from generator.process import available_cores

HEADS_A_WORKER = 12
"""A further process, which works out anew what heads have in common, pays from so many heads on."""


def spread_heads(
    make: Callable[[int], str], numbers: Sequence[int], workers: int | None, prepare: Callable[[], None]
) -> Iterator[str]:
    """What make says of each number, in their order, each as soon as it is made.

    Parameters
    ----------
    make: of a module, or a partial of one; makes a head and gives its name. What it raises is raised here.
    workers: processes at most; None for one a core, where there is enough to do.
    prepare: of a module; what a process does before its first head.

    Raises
    ------
    HeadError: a process was killed.
    """
    enough = 1 + len(numbers) // HEADS_A_WORKER
    count = min(workers or enough, worthwhile(available_cores()), enough)
    if count < 2:
        yield from map(make, numbers)
        return
    try:
        with processes(count, prepare) as spread:
            yield from spread(make, numbers, 1)
    except WorkerError as error:
        raise HeadError(
            "a process that was making heads was killed, perhaps for memory; the heads that are there are "
            "whole. Run it again with --workers 1"
        ) from error

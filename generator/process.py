# SPDX-License-Identifier: GPL-3.0-or-later
"""What a worker process needs from the operating system. stdlib only: the render worker uses it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

from generator.platforms import HERE

_PR_SET_PDEATHSIG = 1
MIB = 2**20


def end_with_parent() -> None:
    """Have the kernel end this process when the thread that started it is gone.

    On Linux, even in the middle of a frame or of a hang. Elsewhere a worker ends
    when its stdin closes, which it notices between two frames.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def resident_mib(pid: int) -> float:
    """Resident memory of a process in MiB; 0 if it is gone, or where there is no /proc."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / MIB
    except (OSError, IndexError):
        return 0.0


@contextmanager
def limited_memory(mib: int) -> Iterator[None]:
    """A block in which this process may take so many MiB more than it has; on Linux alone.

    What wants more gets a MemoryError, or, in native code, ends the process.
    """
    if sys.platform != "linux":
        yield
        return
    resource = import_module("resource")
    with open("/proc/self/statm", encoding="ascii") as file:
        used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    before, most = resource.getrlimit(resource.RLIMIT_AS)
    limit = used + mib * MIB
    if before != resource.RLIM_INFINITY:
        limit = min(limit, before)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, most))


def is_running(pid: int) -> bool:
    """Is there a process with this id?"""
    return HERE.is_running(pid)


def available_cores() -> list[int]:
    """The cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


@contextmanager
def few_cores(count: int) -> Iterator[None]:
    """A block in which this process may use so many of its cores, 0 for all; on Linux alone.

    A library that counts them while it is loaded starts no more threads than that, ever after.
    """
    if not count or sys.platform != "linux":
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), before)


@contextmanager
def native_silence(*streams: int) -> Iterator[None]:
    """What native code writes to stderr, or to these streams by their numbers, is lost; Python's own
    messages are not meant to come in between."""
    kept = {stream: os.dup(stream) for stream in streams or (2,)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in kept:
        os.dup2(nowhere, stream)
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)

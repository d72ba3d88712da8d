# SPDX-License-Identifier: GPL-3.0-or-later
"""What a container, a job of a cluster or a service may use of its machine: control groups, v1 and v2.

Whoever goes by the machine's memory and cores there is killed, or has more processes than get time.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

_PROC = Path("/proc/self")


def memory_limit() -> float:
    """Bytes that all processes of this one's groups may have together; infinity where nothing says it."""
    limits = [math.inf]
    for folder in _folders("memory"):
        for name in ("memory.max", "memory.high", "memory.limit_in_bytes"):
            limits += _numbers(folder / name)[:1]
    return min(limits)


def core_limit() -> float:
    """Cores whose time this process's groups get together; infinity where nothing says it."""
    limits = [math.inf]
    for folder in _folders("cpu"):
        both = _numbers(folder / "cpu.max")
        both = both or _numbers(folder / "cpu.cfs_quota_us") + _numbers(folder / "cpu.cfs_period_us")
        if len(both) == 2 and min(both) > 0:  # a quota of -1 is none
            limits.append(both[0] / both[1])
    return min(limits)


def worthwhile(cores: Sequence[int]) -> int:
    """How many busy processes these cores are good for: fewer where a group gets less than all their time."""
    return max(1, min(len(cores), math.ceil(min(core_limit(), len(cores)))))


def _folders(controller: str) -> Iterator[Path]:
    """Where the limits of this process's group stand, and those of the groups it is in."""
    groups = {}
    for line in _lines(_PROC / "cgroup"):
        _, controllers, path = line.split(":", 2)
        groups.update(dict.fromkeys(controllers.split(","), path))  # of v2: ""
    for line in _lines(_PROC / "mountinfo"):
        before, _, after = line.partition(" - ")
        root, point = before.split()[3:5]
        kind, _, options = after.split()[:3]
        name = {"cgroup2": "", "cgroup": controller}.get(kind)
        if name not in groups or (name and name not in options.split(",")):
            continue
        group, top = PurePosixPath(groups[name]), PurePosixPath(root)
        # In a container's own view of the tree the group's path may be one that only the machine has.
        below = group.relative_to(top) if group.is_relative_to(top) else PurePosixPath()
        folder = Path(point) / below
        yield from [folder, *list(folder.parents)[: len(below.parts)]]


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        return []


def _numbers(file: Path) -> list[float]:
    try:
        words = file.read_text(encoding="ascii").split()
        return [math.inf if word == "max" else float(word) for word in words]
    except (OSError, ValueError):
        return []


def memory_bytes() -> float:
    """What there is for this process and those beside it; infinity if neither group nor machine says."""
    try:
        machine: float = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        machine = math.inf
    return min(machine, memory_limit())

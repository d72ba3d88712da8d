# SPDX-License-Identifier: MIT
"""What benchmarks measured, as JSON, with the machine it was measured on: their option --json FILE."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Figure:
    """ratio: to the yardstick of the same run, such as the naive script; machines differ in it least."""

    name: str
    value: float
    unit: str
    ratio: float | None = None


def write_json(path: Path | None, benchmark: str, figures: Sequence[Figure]) -> None:
    """Write a file of figures; nothing where nobody asked for one."""
    if path is None:
        return
    about = {"benchmark": benchmark, "version": version(), "commit": commit(), "machine": machine()}
    when = {"date": datetime.now(timezone.utc).date().isoformat(), "load": round(os.getloadavg()[0], 1)}
    content = {**about, **when, "figures": [asdict(one) for one in figures]}
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def version() -> str:
    """Of the checkout."""
    text = (HERE / "generator" / "__init__.py").read_text(encoding="utf-8")
    return text.partition('__version__ = "')[2].partition('"')[0]


def commit() -> str:
    """Of the checkout, with + where it was changed; none where it is no git checkout."""
    asked = ["git", "-C", str(HERE), "describe", "--always", "--dirty=+", "--abbrev=10"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()


def machine() -> str:
    """Cores that may be used, and the processor."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    return f"{cores} x {(names or [platform.processor() or platform.machine()])[0]}"

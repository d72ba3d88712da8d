# SPDX-License-Identifier: GPL-3.0-or-later
"""The resident memory of a process's descendants over time."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import psutil

MIB = 2**20


class Resident(threading.Thread):
    """Samples the resident memory of every descendant of a process, each with the time."""

    def __init__(self, of: int | None = None, every_s: float = 0.25) -> None:
        super().__init__(daemon=True)
        self.curves: dict[tuple[int, str], list[tuple[float, float]]] = {}
        """(pid, kind of process) -> (seconds since the start, MiB)."""
        self.most = 0.0
        """MiB of all of them together at most; pages that they share count each time."""
        self._root, self._every_s = psutil.Process(of), every_s
        self._began = time.perf_counter()
        self._stop_now = threading.Event()

    def run(self) -> None:
        """Sample until told to stop."""
        while not self._stop_now.wait(self._every_s):
            try:
                children = self._root.children(recursive=True)
            except psutil.NoSuchProcess:
                return
            together = 0.0
            for child in [self._root, *children]:
                try:
                    words = child.cmdline()
                    kind = next(
                        (word for word in words if word.startswith("generator.")), Path(words[0]).name
                    )
                    sample = (time.perf_counter() - self._began, child.memory_info().rss / MIB)
                except (psutil.NoSuchProcess, psutil.ZombieProcess, IndexError):
                    continue  # it ended between being listed and being asked
                together += sample[1]
                self.curves.setdefault((child.pid, kind), []).append(sample)
            self.most = max(self.most, together)

    def stop(self) -> None:
        """Stop sampling."""
        self._stop_now.set()
        self.join()

    def text(self, points: int = 0) -> str:
        """A line a process: peak, growth over the second half of its life, and points of its curve."""
        lines = []
        for (_, kind), curve in sorted(self.curves.items(), key=lambda item: item[0][1]):
            if len(curve) < 8:
                continue
            sizes = [size for _, size in curve]
            growth = sizes[-1] - sizes[len(sizes) // 2]
            line = f"  {kind:32} peak {max(sizes):5.0f} MiB, growth over the second half {growth:+.1f} MiB"
            if points:
                chosen = sizes[:: max(1, len(sizes) // points)]
                line += "\n    " + " ".join(f"{size:.0f}" for size in chosen)
            lines.append(line)
        return "\n".join(lines)

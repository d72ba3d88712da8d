# SPDX-License-Identifier: GPL-3.0-or-later
"""What people and machines see while a build runs."""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        """Steps a second since the stage began."""
        return Text(f"{task.completed / task.elapsed:.1f}/s" if task.elapsed and task.completed else "")


class TerminalReporter:
    """A progress bar with rate and time left; plain lines where there is no terminal."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._progress = Progress(
            TextColumn("{task.description:16}"),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task: TaskID | None = None

    def __enter__(self) -> TerminalReporter:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def stage(self, name: str, total: int) -> None:
        """A stage begins."""
        if not self._console.is_terminal:
            self._console.print(f"{name}: {total}", highlight=False)
        self._task = self._progress.add_task(name, total=total)

    def advance(self, steps: int = 1) -> None:
        """Steps of the current stage are done."""
        if self._task is not None:
            self._progress.advance(self._task, steps)

    def note(self, text: str) -> None:
        """A line above the bar."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)


class JsonReporter:
    """One JSON object a line: stages, notes, and progress about once a second."""

    INTERVAL_S = 1.0

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self._lock = threading.Lock()
        self._name, self._total, self._done = "", 0, 0
        self._began = self._last = time.monotonic()

    def __enter__(self) -> JsonReporter:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.flush()

    def stage(self, name: str, total: int) -> None:
        """A stage begins."""
        with self._lock:
            self._name, self._total, self._done = name, total, 0
            self._began = self._last = time.monotonic()
            self._write({"event": "stage", "stage": name, "total": total})

    def advance(self, steps: int = 1) -> None:
        """Steps of the current stage are done."""
        with self._lock:
            self._done += steps
            now = time.monotonic()
            if now - self._last >= self.INTERVAL_S or self._done == self._total:
                self._last = now
                rate = self._done / max(now - self._began, 1e-9)
                left = (self._total - self._done) / rate
                self._write(
                    {
                        "event": "progress",
                        "stage": self._name,
                        "done": self._done,
                        "total": self._total,
                        "rate": round(rate, 2),
                        "eta_s": round(left, 1),
                    }
                )

    def note(self, text: str) -> None:
        """A line worth reading."""
        with self._lock:
            self._write({"event": "note", "text": text})

    def _write(self, record: dict[str, object]) -> None:
        self._stream.write(json.dumps(record) + "\n")
        self._stream.flush()

# SPDX-License-Identifier: GPL-3.0-or-later
"""What people and machines see while a build runs."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

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

from generator.cli.console import say


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        """Steps a second since the stage began."""
        return Text(f"{task.completed / task.elapsed:.1f}/s" if task.elapsed and task.completed else "")


class Tally:
    """What a build's events add up to."""

    def __init__(self) -> None:
        self.units = self.restarts = self.quarantined = 0
        self.seconds: Counter[str] = Counter()

    def add(self, kind: str, facts: dict[str, Any]) -> None:
        """Count an event of :class:`generator.execution.status.Reporter`."""
        self.units += kind == "unit"
        self.quarantined += kind == "quarantined"
        self.restarts += facts.get("attempts", 1) - 1
        self.seconds.update(facts.get("seconds", {}))

    @property
    def load(self) -> dict[str, float]:
        """Share of the lanes' time in each stage, the largest first."""
        total = sum(self.seconds.values()) or 1.0
        return {stage: round(spent / total, 3) for stage, spent in self.seconds.most_common()}

    def __str__(self) -> str:
        shares = [f"{stage} {share:.0%}" for stage, share in list(self.load.items())[:3]]
        troubles = [f"{self.restarts} restarts"] if self.restarts else []
        troubles += [f"{self.quarantined} quarantined"] if self.quarantined else []
        return " · ".join(shares + troubles)


class TerminalReporter:
    """A progress bar with rate, time left, load and troubles; plain lines where there is no terminal."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._progress = Progress(
            TextColumn("{task.description:16}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[status]}", style="dim", markup=False),
            console=console,
            disable=not console.is_terminal,
        )
        self._task: TaskID | None = None
        self._tally = Tally()

    def __enter__(self) -> TerminalReporter:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def stage(self, name: str, total: int) -> None:
        """A stage begins."""
        if not self._console.is_terminal:
            say(f"{name}: {total}", self._console)
        self._task = self._progress.add_task(name, total=total, status="")

    def advance(self, steps: int = 1) -> None:
        """Steps of the current stage are done."""
        if self._task is not None:
            self._progress.advance(self._task, steps)

    def note(self, text: str) -> None:
        """A line above the bar."""
        say(text, self._console)

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """Show what the events add up to beside the bar."""
        self._tally.add(kind, facts)
        if self._task is not None:
            self._progress.update(self._task, status=str(self._tally))

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Leave the terminal to a question."""
        self._progress.stop()
        yield
        self._progress.start()


class JsonReporter:
    """One JSON object a line: stages, notes, and progress about once a second."""

    INTERVAL_S = 1.0

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self._lock = threading.Lock()
        self._name, self._total, self._done = "", 0, 0
        self._tally = Tally()
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
                        "load": self._tally.load,
                        "restarts": self._tally.restarts,
                        "quarantined": self._tally.quarantined,
                    }
                )

    def note(self, text: str) -> None:
        """A line worth reading."""
        with self._lock:
            self._write({"event": "note", "text": text})

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """Something happened; see :class:`generator.execution.status.Reporter`."""
        with self._lock:
            self._tally.add(kind, facts)
            self._write({"event": kind, **facts})

    def _write(self, record: dict[str, object]) -> None:
        self._stream.write(json.dumps(record) + "\n")
        self._stream.flush()
